#include <algorithm>
#include <map>
#include <optional>

#include "treemarch/mesh/mesh_input.h"

namespace treemarch {
namespace {

/// Finds the place of a tag among many. Tags are mostly 1, 2, 3, ...
class TagIndex {
 public:
  explicit TagIndex(std::vector<std::uint64_t> tags) {
    dense_ = true;
    for (std::size_t i = 0; i < tags.size() && dense_; ++i) dense_ = tags[i] == i + 1;
    if (dense_) {
      size_ = tags.size();
      return;
    }
    for (std::size_t i = 0; i < tags.size(); ++i) sorted_.emplace_back(tags[i], static_cast<std::int64_t>(i));
    std::sort(sorted_.begin(), sorted_.end());
  }
  /// -1 where there is none.
  [[nodiscard]] std::int64_t find(std::uint64_t tag) const {
    if (dense_) return tag >= 1 && tag <= size_ ? static_cast<std::int64_t>(tag - 1) : -1;
    const auto at = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(tag, std::int64_t{0}));
    return at != sorted_.end() && at->first == tag ? at->second : -1;
  }

 private:
  bool dense_ = true;
  std::size_t size_ = 0;
  std::vector<std::pair<std::uint64_t, std::int64_t>> sorted_;
};

std::optional<CellType> cell_type(std::int32_t type) {
  constexpr std::pair<std::int32_t, CellType> kTypes[] = {{1, CellType::line},       {2, CellType::triangle},
                                                          {3, CellType::quad},       {4, CellType::tetrahedron},
                                                          {5, CellType::hexahedron}, {7, CellType::pyramid}};
  for (const auto& [number, t] : kTypes)
    if (number == type) return t;
  return {};
}

class MshReader {
 public:
  explicit MshReader(std::string_view file) : in_(file) {}

  MeshInput run() {
    if (in_.line() != "$MeshFormat") throw BadFile("is not a Gmsh file");
    read_format();
    for (in_.skip_space(); !in_.at_end(); in_.skip_space()) {
      const std::string section(in_.line());
      if (section.size() < 2 || section[0] != '$') throw BadFile("has no section where one should be");
      if (section == "$Entities") read_entities();
      if (section == "$Nodes") read_nodes();
      if (section == "$Elements") read_elements();
      if (section == "$ElementData") read_element_data();
      in_.skip_past("$End" + section.substr(1));
    }
    set_labels();
    return std::move(mesh_);
  }

 private:
  template <class T>
  T get() {
    return binary_ ? in_.binary<T>() : in_.number<T>();
  }
  /// A count of things of at least so many numbers each.
  std::size_t get_count(std::size_t numbers) {
    return in_.checked_count(get<std::uint64_t>(), numbers * (binary_ ? 4 : 2));
  }

  void read_format() {
    if (in_.word() != "4.1") throw BadFile("is not of Gmsh's format 4.1; export it as that");
    binary_ = in_.number<int>() != 0;
    if (in_.number<int>() != 8) throw BadFile("has no 8-byte sizes");
    in_.line();
    if (binary_ && in_.binary<std::int32_t>() != 1) throw BadFile("is big-endian; export it on a common machine");
    in_.skip_past("$EndMeshFormat");
  }

  void read_entities() {
    std::array<std::size_t, 4> counts{};
    for (std::size_t& n : counts) n = get_count(4);
    for (int dim = 0; dim < 4; ++dim) {
      for (std::size_t i = 0; i < counts[dim]; ++i) {
        const auto tag = get<std::int32_t>();
        for (int k = 0; k < (dim == 0 ? 3 : 6); ++k) get<double>();
        for (std::size_t n = get_count(1), k = 0; k < n; ++k) {
          const auto physical = get<std::int32_t>();
          if (k == 0) physical_[{dim, tag}] = physical;
        }
        if (dim > 0)
          for (std::size_t n = get_count(1), k = 0; k < n; ++k) get<std::int32_t>();
      }
    }
  }

  void read_nodes() {
    const std::size_t blocks = get_count(4);
    const std::size_t nodes = get_count(4);
    for (int k = 0; k < 2; ++k) get<std::uint64_t>();
    std::vector<std::uint64_t> tags;
    tags.reserve(nodes);
    for (std::size_t b = 0; b < blocks; ++b) {
      const auto dim = get<std::int32_t>();
      get<std::int32_t>();
      const bool parametric = get<std::int32_t>() != 0;
      if (dim < 0 || dim > 3) throw BadFile("has an entity of more than three dimensions");
      const std::size_t count = get_count(4);
      for (std::size_t i = 0; i < count; ++i) tags.push_back(get<std::uint64_t>());
      for (std::size_t i = 0; i < count; ++i) {
        Vec<3>& p = mesh_.points.emplace_back();
        for (double& x : p) x = get<double>();
        for (int k = 0; k < dim && parametric; ++k) get<double>();
      }
    }
    nodes_.emplace(std::move(tags));
  }

  void read_elements() {
    if (!nodes_) throw BadFile("lists elements before nodes");
    const std::size_t blocks = get_count(4);
    for (int k = 0; k < 3; ++k) get<std::uint64_t>();
    for (std::size_t b = 0; b < blocks; ++b) {
      const auto dim = get<std::int32_t>();
      const auto entity = get<std::int32_t>();
      const auto type_number = get<std::int32_t>();
      const std::size_t count = get_count(2);
      constexpr std::int32_t kPoint = 15;
      const std::optional<CellType> type = cell_type(type_number);
      if (!type && type_number != kPoint)
        throw BadFile("has elements of type " + std::to_string(type_number) + ", which are not supported");
      const auto group = physical_.find({dim, entity});
      MeshInput::Cells* cells = type ? &mesh_.cells_of(*type) : nullptr;
      for (std::size_t i = 0; i < count; ++i) {
        const auto tag = get<std::uint64_t>();
        for (int k = 0, n = type ? vertex_count(*type) : 1; k < n; ++k) {
          const std::int64_t vertex = nodes_->find(get<std::uint64_t>());
          if (cells) cells->vertices.push_back(vertex);
        }
        if (!cells) continue;
        has_groups_ = has_groups_ && group != physical_.end();
        cells->labels.push_back(group == physical_.end() ? 0 : group->second);
        element_tags_.push_back(tag);
      }
    }
  }

  void read_element_data() {
    std::string name;
    for (int n = in_.number<int>(), k = 0; k < n; ++k) {
      in_.skip_space();
      const std::string_view text = in_.line();
      if (k == 0) name = text;
    }
    for (int n = in_.number<int>(), k = 0; k < n; ++k) in_.number<double>();
    std::int64_t components = 1, count = 0;
    for (int n = in_.number<int>(), k = 0; k < n; ++k) {
      const auto value = in_.number<std::int64_t>();
      if (k == 1) components = value;
      if (k == 2) count = value;
    }
    in_.line();
    if (name != "\"label\"" || components != 1) return;
    const std::size_t values = in_.checked_count(count, binary_ ? 12 : 4);
    data_tags_.reserve(values);
    for (std::size_t i = 0; i < values; ++i) {
      data_tags_.push_back(static_cast<std::uint64_t>(get<std::int32_t>()));
      const auto value = get<double>();
      if (!(value >= -2147483648.0 && value <= 2147483647.0)) throw BadFile("has a label beyond 32 bit");
      data_.push_back(static_cast<std::int32_t>(value));
    }
  }

  void set_labels() {
    if (data_.empty()) {
      if (!has_groups_) throw BadFile("has cells without a physical group and no element array \"label\"");
      return;
    }
    const TagIndex index(std::move(data_tags_));
    std::size_t e = 0;
    for (MeshInput::Cells& cells : mesh_.cells)
      for (std::int32_t& label : cells.labels) {
        const std::int64_t at = index.find(element_tags_[e++]);
        if (at < 0) throw BadFile("has cells without a value in the element array \"label\"");
        label = data_[at];
      }
  }

  Cursor in_;
  bool binary_ = false;
  MeshInput mesh_;
  std::map<std::pair<int, std::int32_t>, std::int32_t> physical_;  // of (dimension, entity)
  std::optional<TagIndex> nodes_;
  std::vector<std::uint64_t> element_tags_;  // in the order of mesh_.cells
  bool has_groups_ = true;
  std::vector<std::uint64_t> data_tags_;
  std::vector<std::int32_t> data_;
};

}  // namespace

MeshInput read_msh(std::string_view file) { return MshReader(file).run(); }

}  // namespace treemarch

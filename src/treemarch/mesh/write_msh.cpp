// Gmsh's format, version 4.1, binary: one entity and one physical group for each group of cells.
#include <algorithm>
#include <limits>
#include <set>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/mesh_source.h"

namespace treemarch {
namespace {

constexpr std::int64_t kChunk = 1 << 16;

constexpr std::int32_t msh_type(CellType type) {
  constexpr std::int32_t kTypes[] = {1, 2, 3, 4, 7, 5};
  return kTypes[static_cast<int>(type)];
}

/// The cells of one block and group: what an element block of the format holds.
struct Run {
  std::size_t block;
  std::uint32_t group;
  std::int64_t begin, end;  ///< in the order of the block
};

/// Cells sorted by block, then group, else in their order.
struct Order {
  std::vector<std::vector<std::uint32_t>> cells;  ///< per block
  std::vector<Run> runs;
};

Order sort_by_group(const MeshSource& mesh) {
  Order order;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const MeshSource::Block& block = mesh.blocks[b];
    std::vector<std::int64_t> begin(mesh.groups.size() + 1);
    for (std::int64_t c = 0; c < block.size; ++c) ++begin[block.groups[c]];
    exclusive_scan(std::span(begin));
    for (std::uint32_t g = 0; g < mesh.groups.size(); ++g)
      if (begin[g] < begin[g + 1]) order.runs.push_back({b, g, begin[g], begin[g + 1]});
    std::vector<std::uint32_t>& cells = order.cells.emplace_back(static_cast<std::size_t>(block.size));
    for (std::int64_t c = 0; c < block.size; ++c) cells[begin[block.groups[c]]++] = static_cast<std::uint32_t>(c);
  }
  return order;
}

/// Physical tags, which must be positive: the label itself where it can be, else some number that is no label.
std::vector<std::int32_t> physical_tags(const MeshSource& mesh) {
  std::set<std::int32_t> taken;
  const bool are_labels = mesh.array_names.size() == 1;
  for (const MeshSource::Group& g : mesh.groups)
    if (are_labels) taken.insert(g.values[0]);
  std::vector<std::int32_t> tags;
  std::int32_t next = 1;
  for (const MeshSource::Group& g : mesh.groups) {
    if (are_labels && g.values[0] > 0) {
      tags.push_back(g.values[0]);
      continue;
    }
    while (taken.count(next)) ++next;
    tags.push_back(next++);
  }
  return tags;
}

std::array<double, 6> bounds_of(const MeshSource& mesh, const Execution& execution) {
  using Bounds = std::array<double, 6>;
  constexpr double kFar = std::numeric_limits<double>::max();
  auto join = [](Bounds a, const Bounds& b) {
    for (int d = 0; d < 3; ++d) {
      a[d] = std::min(a[d], b[d]);
      a[3 + d] = std::max(a[3 + d], b[3 + d]);
    }
    return a;
  };
  return parallel_reduce(
      execution, mesh.point_count, kChunk, Bounds{kFar, kFar, kFar, -kFar, -kFar, -kFar},
      [&](std::int64_t begin, std::int64_t end) {
        std::vector<double> xyz(static_cast<std::size_t>(3 * (end - begin)));
        mesh.points(begin, end, xyz.data());
        Bounds bounds{kFar, kFar, kFar, -kFar, -kFar, -kFar};
        for (std::size_t i = 0; i < xyz.size(); i += 3)
          bounds = join(bounds, {xyz[i], xyz[i + 1], xyz[i + 2], xyz[i], xyz[i + 1], xyz[i + 2]});
        return bounds;
      },
      join);
}

void write_head(const MeshSource& mesh, const std::vector<std::int32_t>& tags, OutputFile& file,
                const Execution& execution) {
  std::string out = "$MeshFormat\n4.1 1 8\n";
  append_bytes(out, std::int32_t{1});
  out += "\n$EndMeshFormat\n$Comments\n" + describe_frame(mesh, "") + "$EndComments\n";

  out += "$PhysicalNames\n" + std::to_string(mesh.groups.size()) + "\n";
  std::vector<std::size_t> by_tag(tags.size());
  for (std::size_t i = 0; i < by_tag.size(); ++i) by_tag[i] = i;
  std::sort(by_tag.begin(), by_tag.end(), [&](std::size_t a, std::size_t b) { return tags[a] < tags[b]; });
  for (const std::size_t g : by_tag)
    out += std::to_string(mesh.cell_dimension) + " " + std::to_string(tags[g]) + " \"" + mesh.groups[g].name + "\"\n";
  out += "$EndPhysicalNames\n$Entities\n";

  const std::array<double, 6> bounds = bounds_of(mesh, execution);
  for (int d = 0; d < 4; ++d) append_bytes(out, std::uint64_t{d == mesh.cell_dimension ? mesh.groups.size() : 0});
  for (std::size_t g = 0; g < mesh.groups.size(); ++g) {
    append_bytes(out, static_cast<std::int32_t>(g + 1));
    for (const double x : bounds) append_bytes(out, x);
    append_bytes(out, std::uint64_t{1});
    append_bytes(out, tags[g]);
    append_bytes(out, std::uint64_t{0});  // bounding entities are not listed
  }
  file.write(out + "\n$EndEntities\n");
}

void write_nodes(const MeshSource& mesh, OutputFile& file, const Execution& execution) {
  const auto count = static_cast<std::uint64_t>(mesh.point_count);
  std::string out = "$Nodes\n";
  for (const std::uint64_t n : {std::uint64_t{1}, count, std::uint64_t{1}, count}) append_bytes(out, n);
  // All belong to the first entity: which one does not matter to any reader, that it exists does.
  for (const std::int32_t n : {mesh.cell_dimension, 1, 0}) append_bytes(out, n);
  append_bytes(out, count);
  file.write(out);
  write_chunks(file, execution, mesh.point_count, kChunk, [](std::int64_t begin, std::int64_t end, std::string& to) {
    for (std::int64_t i = begin; i < end; ++i) append_bytes(to, static_cast<std::uint64_t>(i + 1));
  });
  write_chunks(file, execution, mesh.point_count, kChunk, [&](std::int64_t begin, std::int64_t end, std::string& to) {
    std::vector<double> xyz(static_cast<std::size_t>(3 * (end - begin)));
    mesh.points(begin, end, xyz.data());
    to.assign(reinterpret_cast<const char*>(xyz.data()), xyz.size() * sizeof(double));
  });
  file.write("\n$EndNodes\n");
}

void write_elements(const MeshSource& mesh, const Order& order, OutputFile& file, const Execution& execution) {
  const auto count = static_cast<std::uint64_t>(mesh.cell_count());
  std::string out = "$Elements\n";
  for (const std::uint64_t n : {std::uint64_t{order.runs.size()}, count, std::uint64_t{1}, count}) append_bytes(out, n);
  file.write(out);
  std::uint64_t tag = 1;
  for (const Run& run : order.runs) {
    const MeshSource::Block& block = mesh.blocks[run.block];
    const int corners = vertex_count(block.type);
    const auto& mirrored = mirrored_order(block.type);
    out.clear();
    for (const std::int32_t n : {mesh.cell_dimension, static_cast<std::int32_t>(run.group + 1), msh_type(block.type)})
      append_bytes(out, n);
    append_bytes(out, static_cast<std::uint64_t>(run.end - run.begin));
    file.write(out);
    write_chunks(file, execution, run.end - run.begin, kChunk,
                 [&](std::int64_t begin, std::int64_t end, std::string& to) {
                   to.reserve(static_cast<std::size_t>(end - begin) * 8 * (1 + static_cast<std::size_t>(corners)));
                   for (std::int64_t i = begin; i < end; ++i) {
                     append_bytes(to, tag + static_cast<std::uint64_t>(i));
                     const std::int64_t c = order.cells[run.block][run.begin + i];
                     const VertexId* v = block.vertices + c * corners;
                     for (int k = 0; k < corners; ++k)
                       append_bytes(to, std::uint64_t{v[mesh.mirrored ? mirrored[k] : k]} + 1);
                   }
                 });
    tag += static_cast<std::uint64_t>(run.end - run.begin);
  }
  file.write("\n$EndElements\n");
}

/// A section of one value an item: its head, what `values` appends, its end.
template <class Values>
void write_section(const std::string& section, const std::string& name, std::int64_t count, OutputFile& file,
                   const Values& values) {
  file.write("$" + section + "\n1\n\"" + name + "\"\n1\n0\n3\n0\n1\n" + std::to_string(count) + "\n");
  values();
  file.write("\n$End" + section + "\n");
}

/// value(block, cell of the block, group) of each element, in the order of the elements.
template <class Value>
void write_cell_values(const MeshSource& mesh, const Order& order, const std::string& name, OutputFile& file,
                       const Execution& execution, const Value& value) {
  write_section("ElementData", name, mesh.cell_count(), file, [&] {
    std::int32_t tag = 1;
    for (const Run& run : order.runs) {
      write_chunks(file, execution, run.end - run.begin, kChunk,
                   [&](std::int64_t begin, std::int64_t end, std::string& to) {
                     for (std::int64_t i = begin; i < end; ++i) {
                       append_bytes(to, tag + static_cast<std::int32_t>(i));
                       append_bytes(to, double{value(run.block, order.cells[run.block][run.begin + i], run.group)});
                     }
                   });
      tag += static_cast<std::int32_t>(run.end - run.begin);
    }
  });
}

void write_extras(const MeshSource& mesh, const Order& order, OutputFile& file, const Execution& execution) {
  std::vector<std::int64_t> first;  // cell of each block
  std::int64_t cells = 0;
  for (const MeshSource::Block& block : mesh.blocks) {
    first.push_back(cells);
    cells += block.size;
  }
  for (const MeshSource::Array& array : mesh.cell_arrays)
    write_cell_values(
        mesh, order, array.name, file, execution,
        [&](std::size_t block, std::int64_t c, std::uint32_t) -> double { return array.values[first[block] + c]; });
  for (const MeshSource::Array& array : mesh.point_arrays)
    write_section("NodeData", array.name, mesh.point_count, file, [&] {
      write_chunks(file, execution, mesh.point_count, kChunk,
                   [&](std::int64_t begin, std::int64_t end, std::string& to) {
                     for (std::int64_t i = begin; i < end; ++i) {
                       append_bytes(to, static_cast<std::int32_t>(i + 1));
                       append_bytes(to, static_cast<double>(array.values[i]));
                     }
                   });
    });
}

}  // namespace

void write_msh(const MeshSource& mesh, OutputFile& file, const Execution& execution) {
  if (std::max(mesh.cell_count(), mesh.point_count) > std::numeric_limits<std::int32_t>::max())
    throw Error(ErrorKind::limits, ".msh: its arrays number cells with 32 bits, and there are more; choose .vtu");
  const std::vector<std::int32_t> tags = physical_tags(mesh);
  const Order order = sort_by_group(mesh);
  write_head(mesh, tags, file, execution);
  write_nodes(mesh, file, execution);
  write_elements(mesh, order, file, execution);
  write_extras(mesh, order, file, execution);
  bool are_labels = mesh.array_names.size() == 1;
  for (std::size_t g = 0; g < tags.size(); ++g) are_labels = are_labels && tags[g] == mesh.groups[g].values[0];
  if (are_labels) return;
  for (std::size_t a = 0; a < mesh.array_names.size(); ++a)
    write_cell_values(
        mesh, order, mesh.array_names[a], file, execution,
        [&](std::size_t, std::int64_t, std::uint32_t group) -> double { return mesh.groups[group].values[a]; });
}

}  // namespace treemarch

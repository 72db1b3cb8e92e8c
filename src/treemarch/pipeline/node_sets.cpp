#include "treemarch/pipeline/node_sets.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/pipeline/label_table.h"

namespace treemarch {
namespace {

constexpr double kBorder = 1e-6;  // of the mesh's largest side

struct Description {
  enum class Kind { box, plane, nodes } kind{};
  std::string name;
  std::vector<double> numbers;                                ///< of a box or plane
  std::vector<std::pair<std::int32_t, std::int32_t>> ranges;  ///< of nodes, both ends included
};

[[noreturn]] void refuse(const std::string& text, const std::string& why) {
  throw Error(ErrorKind::usage, "--node-set: '" + text + "' " + why);
}

Description parse(const std::string& text, int dimension) {
  const std::size_t equals = text.find('=');
  const std::size_t colon = text.find(':', equals == std::string::npos ? 0 : equals);
  if (equals == std::string::npos || equals == 0 || colon == std::string::npos)
    refuse(text, "is not of the form NAME=box:..., NAME=plane:... or NAME=nodes:...");
  Description set;
  set.name = text.substr(0, equals);
  // Names become those of arrays, groups and XML attributes.
  if (set.name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.") !=
          set.name.npos ||
      set.name == "partition" || set.name == "time")
    refuse(text, "has a name of other signs than letters, digits and _-., or one that has a meaning");
  const std::string kind = text.substr(equals + 1, colon - equals - 1);
  const auto items = split(std::string_view(text).substr(colon + 1), ',');
  if (kind == "nodes") {
    set.kind = Description::Kind::nodes;
    for (const std::string_view item : items) {
      const auto ends = split(item, '-');
      std::int32_t first = 0, last = 0;
      if (ends.size() > 2 || !parse_int32(ends[0], first) || !parse_int32(ends.back(), last) || first < 0 ||
          first > last)
        refuse(text, "names nodes by other things than numbers from 0 and ranges of them");
      set.ranges.emplace_back(first, last);
    }
    return set;
  }
  for (const std::string_view item : items) {
    double value = 0;
    if (!parse_double(item, value)) refuse(text, "has '" + std::string(item) + "' where a number should be");
    set.numbers.push_back(value);
  }
  const auto count = static_cast<int>(set.numbers.size());
  if (kind == "box") {
    set.kind = Description::Kind::box;
    if (count != 2 * dimension)
      refuse(text, "must give " + std::to_string(2 * dimension) + " numbers, the lower corner, then the upper");
    for (int d = 0; d < dimension; ++d)
      if (set.numbers[static_cast<std::size_t>(d)] > set.numbers[static_cast<std::size_t>(d + dimension)])
        refuse(text, "has a lower corner above the upper one");
  } else if (kind == "plane") {
    set.kind = Description::Kind::plane;
    if (count != dimension + 1 && count != dimension + 2)
      refuse(text, "must give the " + std::to_string(dimension) +
                       " coordinates of a normal, the distance and perhaps a width");
    if (std::all_of(set.numbers.begin(), set.numbers.begin() + dimension, [](double x) { return x == 0; }))
      refuse(text, "has no normal");
  } else {
    refuse(text, "is none of box, plane and nodes");
  }
  return set;
}

std::vector<Description> parse_all(const std::vector<std::string>& texts, int dimension) {
  std::vector<Description> sets;
  std::set<std::string> names;
  for (const std::string& text : texts) {
    sets.push_back(parse(text, dimension));
    if (!names.insert(sets.back().name).second) refuse(text, "takes a name that another set has");
  }
  return sets;
}

template <int Dim>
std::function<bool(const Vec<Dim>&)> inside(const Description& set, double border) {
  const std::vector<double>& n = set.numbers;
  if (set.kind == Description::Kind::box)
    return [&n, border](const Vec<Dim>& x) {
      for (int d = 0; d < Dim; ++d)
        if (x[d] < n[d] - border || x[d] > n[d + Dim] + border) return false;
      return true;
    };
  Vec<Dim> normal{};
  std::copy_n(n.begin(), Dim, normal.begin());
  const double length = norm(normal);
  const double width = (n.size() > Dim + 1 ? n.back() : 0) + border;
  return [normal, length, width, at = n[Dim]](const Vec<Dim>& x) {
    return std::abs(dot(normal, x) - at) <= width * length;
  };
}

}  // namespace

void check_node_sets(const std::vector<std::string>& texts, int dimension) { (void)parse_all(texts, dimension); }

template <int Dim>
std::vector<NodeSet> find_node_sets(const std::vector<std::string>& texts, const Mesh<Dim>& mesh,
                                    const Frame<Dim>& frame, const Execution& execution) {
  std::vector<NodeSet> result;
  if (texts.empty()) return result;
  std::vector<Vec<Dim>> points(mesh.points.size());
  parallel_for(execution, std::ssize(points), 1 << 14, [&](std::int64_t i) {
    points[static_cast<std::size_t>(i)] = to_world(frame, mesh.points[static_cast<std::size_t>(i)]);
  });
  double size = 0;
  for (int d = 0; d < Dim; ++d) {
    const auto [low, high] = std::ranges::minmax_element(points, {}, [d](const Vec<Dim>& p) { return p[d]; });
    size = std::max(size, (*high)[d] - (*low)[d]);
  }
  for (const Description& set : parse_all(texts, Dim)) {
    NodeSet& found = result.emplace_back();
    found.name = set.name;
    if (set.kind == Description::Kind::nodes) {
      for (const auto& [first, last] : set.ranges) {
        if (static_cast<std::size_t>(last) >= points.size())
          refuse(set.name,
                 "names node " + std::to_string(last) + ", but the mesh has " + std::to_string(points.size()));
        for (std::int32_t v = first; v <= last; ++v) found.vertices.push_back(static_cast<VertexId>(v));
      }
      std::ranges::sort(found.vertices);
      found.vertices.erase(std::unique(found.vertices.begin(), found.vertices.end()), found.vertices.end());
    } else {
      const auto is_inside = inside<Dim>(set, kBorder * size);
      for (std::size_t v = 0; v < points.size(); ++v)
        if (is_inside(points[v])) found.vertices.push_back(static_cast<VertexId>(v));
    }
    if (found.vertices.empty()) refuse(set.name, "holds no node; coordinates are those of the mesh file");
  }
  return result;
}

#define TREEMARCH_INSTANTIATE(DIM)                                                                                   \
  template std::vector<NodeSet> find_node_sets(const std::vector<std::string>&, const Mesh<DIM>&, const Frame<DIM>&, \
                                               const Execution&);
TREEMARCH_INSTANTIATE(2)
TREEMARCH_INSTANTIATE(3)
TREEMARCH_INSTANTIATE(4)
#undef TREEMARCH_INSTANTIATE

}  // namespace treemarch

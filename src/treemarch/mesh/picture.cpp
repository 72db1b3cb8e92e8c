#include "treemarch/mesh/picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/core/parallel.h"
#include "treemarch/mesh/cell_topology.h"
#include "treemarch/mesh/facets.h"
#include "treemarch/mesh/output_file.h"
#include "treemarch/mesh/output_frame.h"
#include "treemarch/mesh/raster.h"

namespace treemarch {
namespace {

constexpr std::int64_t kBlock = 16384;
constexpr double kMargin = 0.05;  // of the picture, on each side

struct Bounds {
  Vec<3> low = Frame<3>::filled(std::numeric_limits<double>::max());
  Vec<3> high = Frame<3>::filled(-std::numeric_limits<double>::max());
  void add(const Vec<3>& p) {
    for (int d = 0; d < 3; ++d) {
      low[d] = std::min(low[d], p[d]);
      high[d] = std::max(high[d], p[d]);
    }
  }
  [[nodiscard]] static Bounds joined(Bounds a, const Bounds& b) {
    for (int d = 0; d < 3; ++d) {
      a.low[d] = std::min(a.low[d], b.low[d]);
      a.high[d] = std::max(a.high[d], b.high[d]);
    }
    return a;
  }
};

Vec<3> centroid(const Mesh<3>& mesh, const CellBlock& block, std::int64_t c) {
  const int n = vertex_count(block.type);
  Vec<3> sum{};
  for (int i = 0; i < n; ++i) sum = sum + mesh.points[block.cell(c)[i]];
  return (1.0 / n) * sum;
}

/// A polygon of the picture before it is placed there.
struct Face {
  std::array<VertexId, 4> vertex;
  std::uint8_t size;
  MaterialId material;
};

/// For each block: which cells are drawn.
using Shown = std::vector<std::vector<std::uint8_t>>;

/// All cells but those of the background; all where there is nothing else.
Shown foreground(const Mesh<3>& mesh, const PictureOptions& options) {
  std::vector<std::uint8_t> wanted(mesh.labels.size(), 1);
  for (std::size_t m = 0; m < wanted.size() && wanted.size() > 1; ++m) wanted[m] = options.background != mesh.labels[m];
  Shown shown;
  for (const CellBlock& block : mesh.blocks) {
    std::vector<std::uint8_t>& s = shown.emplace_back(static_cast<std::size_t>(block.size()));
    for (std::size_t c = 0; c < s.size(); ++c) s[c] = wanted[block.materials[c]];
  }
  return shown;
}

/// Takes the cells away that lie in the octant (of the shown cells' box) to which `toward` points.
void cut_octant(const Mesh<3>& mesh, const Vec<3>& toward, Shown& shown, const Execution& execution) {
  Bounds box;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const CellBlock& block = mesh.blocks[b];
    box = parallel_reduce(
        execution, block.size(), kBlock, box,
        [&](std::int64_t begin, std::int64_t end) {
          Bounds bounds;
          for (std::int64_t c = begin; c < end; ++c)
            if (shown[b][c]) bounds.add(centroid(mesh, block, c));
          return bounds;
        },
        Bounds::joined);
  }
  const Vec<3> middle = 0.5 * (box.low + box.high);
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    parallel_for(execution, mesh.blocks[b].size(), kBlock, [&](std::int64_t c) {
      const Vec<3> p = centroid(mesh, mesh.blocks[b], c) - middle;
      if (p[0] * toward[0] > 0 && p[1] * toward[1] > 0 && p[2] * toward[2] > 0) shown[b][c] = 0;
    });
  }
}

/// Facets between what is shown and what is not.
std::vector<Face> visible_faces(const Mesh<3>& mesh, const Shown& shown, const Execution& execution) {
  std::vector<std::vector<Face>> parts(facet_part_count(static_cast<std::int64_t>(mesh.points.size())));
  visit_facets<3>(mesh, execution, [&](std::int64_t part, std::span<const FacetSide> sides) {
    const FacetSide* only = nullptr;
    for (const FacetSide& side : sides) {
      if (!shown[side.block][side.cell]) continue;
      if (only) return;
      only = &side;
    }
    if (!only) return;
    const CellBlock& block = mesh.blocks[only->block];
    const LocalFacet& facet = topology(block.type).facets[only->facet];
    Face face{{}, facet.size, block.materials[only->cell]};
    for (int i = 0; i < facet.size; ++i) face.vertex[i] = block.cell(only->cell)[facet.vertex[i]];
    parts[part].push_back(face);
  });
  std::vector<Face> faces;
  for (const auto& p : parts) faces.insert(faces.end(), p.begin(), p.end());
  return faces;
}

/// Orthonormal axes of the picture: to the right, up, towards the eye.
struct View {
  Vec<3> right, up, toward;
};

View view_from(const Vec<3>& direction, const Vec<3>& vertical) {
  View view;
  view.toward = (1 / norm(direction)) * direction;
  view.right = cross(vertical, view.toward);
  view.right = (1 / norm(view.right)) * view.right;
  view.up = cross(view.toward, view.right);
  return view;
}

/// Two lamps and a little light from everywhere.
float brightness(const Vec<3>& normal, const View& view) {
  auto lamp = [&](double right, double up, double toward) {
    const Vec<3> d = right * view.right + up * view.up + toward * view.toward;
    return std::max(0.0, dot(normal, d) / norm(d));
  };
  return static_cast<float>(0.30 + 0.62 * lamp(-0.5, 0.8, 1) + 0.18 * lamp(1, 0.1, 0.6));
}

/// Places points in the picture: scaled to fit, as large as the margin allows.
struct Placement {
  double scale = 1, x = 0, y = 0;
  Placement(const Bounds& bounds, int width, int height) {
    const double w = std::max(bounds.high[0] - bounds.low[0], 1e-300);
    const double h = std::max(bounds.high[1] - bounds.low[1], 1e-300);
    scale = (1 - 2 * kMargin) * std::min(width / w, height / h);
    x = 0.5 * width - 0.5 * scale * (bounds.low[0] + bounds.high[0]);
    y = 0.5 * height + 0.5 * scale * (bounds.low[1] + bounds.high[1]);
  }
  [[nodiscard]] std::array<float, 3> operator()(const Vec<3>& p) const {
    return {static_cast<float>(x + scale * p[0]), static_cast<float>(y - scale * p[1]),
            static_cast<float>(scale * p[2])};
  }
};

/// Cuts a polygon into triangles whose inner sides are not drawn.
template <class Corner>
void add_face(const Face& face, const Corner& corner, const Colour& colour, std::vector<ScreenTriangle>& to) {
  for (int k = 2; k < face.size; ++k) {
    ScreenTriangle t;
    t.corner = {corner(face.vertex[0]), corner(face.vertex[k - 1]), corner(face.vertex[k])};
    t.edge = {true, k == face.size - 1, k == 2};
    t.colour = colour;
    to.push_back(t);
  }
}

void write_png(const std::string& path, bool overwrite, const Raster& raster) {
  OutputFile file(path, overwrite);
  const std::vector<std::uint8_t> bytes = encode_png(raster);
  file.write(bytes.data(), bytes.size());
  file.commit();
}

Colour shaded(const Colour& colour, float light) { return {colour[0] * light, colour[1] * light, colour[2] * light}; }

constexpr Colour kTop{0.98F, 0.985F, 0.99F};
constexpr Colour kBottom{0.80F, 0.83F, 0.87F};

/// The axes of anatomy where the frame knows them, else its own.
template <int Dim>
Frame<Dim> anatomical(const Frame<Dim>& frame) {
  try {
    return output_frame(frame, OutputSpace::ras);
  } catch (const Error&) {
    return frame;
  }
}

Raster picture_of(const Mesh<3>& mesh, const Frame<3>& given, const PictureOptions& options,
                  const Execution& execution) {
  const Frame<3> frame = anatomical(given);
  const View view = view_from({-0.62, 0.78, 0.52}, {0, 0, 1});
  Vec<3> toward;
  for (int c = 0; c < 3; ++c) toward[c] = dot(frame.direction[c], view.toward);
  Shown shown = foreground(mesh, options);
  cut_octant(mesh, toward, shown, execution);
  const std::vector<Face> faces = visible_faces(mesh, shown, execution);

  // Mild perspective: dividing by a linear function keeps planes plane, so that depth stays linear in the picture.
  auto seen = [&](const Vec<3>& world) {
    return Vec<3>{dot(world, view.right), dot(world, view.up), dot(world, view.toward)};
  };
  Bounds straight;
  for (const Face& f : faces)
    for (int i = 0; i < f.size; ++i) straight.add(seen(to_world(frame, mesh.points[f.vertex[i]])));
  const Vec<3> centre = 0.5 * (straight.low + straight.high);
  const double distance = 3 * std::max(norm(straight.high - straight.low), 1e-300);
  auto projected = [&](VertexId v) {
    const Vec<3> p = seen(to_world(frame, mesh.points[v])) - centre;
    return (1 / (1 - p[2] / distance)) * p;
  };
  Bounds bounds;
  for (const Face& f : faces)
    for (int i = 0; i < f.size; ++i) bounds.add(projected(f.vertex[i]));

  const int width = options.width, height = options.width * 3 / 4;
  const Placement place(faces.empty() ? Bounds::joined({}, {{0, 0, 0}, {1, 1, 1}}) : bounds, 2 * width, 2 * height);
  std::vector<ScreenTriangle> triangles;
  for (const Face& f : faces) {
    const Vec<3> a = to_world(frame, mesh.points[f.vertex[0]]);
    Vec<3> normal = cross(to_world(frame, mesh.points[f.vertex[1]]) - a, to_world(frame, mesh.points[f.vertex[2]]) - a);
    const double length = norm(normal);
    if (!(length > 0)) continue;
    normal = ((dot(normal, view.toward) < 0 ? -1 : 1) / length) * normal;
    add_face(
        f, [&](VertexId v) { return place(projected(v)); },
        shaded(label_colour(mesh.labels[f.material]), brightness(normal, view)), triangles);
  }
  Raster raster = reduced(rasterise(triangles, 2 * width, 2 * height, 1.1F, execution), kTop, kBottom, execution);
  darken_hollows(raster, width / 50, static_cast<float>(place.scale * distance / 3 / 12), execution);
  return raster;
}

Raster picture_of(const Mesh<2>& mesh, const Frame<2>& frame, const PictureOptions& options,
                  const Execution& execution) {
  const double up = frame.space.empty() ? -1 : 1;
  auto seen = [&](VertexId v) {
    const Vec<2> w = to_world(frame, mesh.points[v]);
    return Vec<3>{w[0], up * w[1], 0};
  };
  Bounds bounds;
  for (VertexId v = 0; v < mesh.points.size(); ++v) bounds.add(seen(v));
  const double ratio = (bounds.high[1] - bounds.low[1]) / std::max(bounds.high[0] - bounds.low[0], 1e-300);
  const int width = options.width, height = static_cast<int>(options.width * std::clamp(ratio, 0.25, 2.0));
  const Placement place(bounds, 2 * width, 2 * height);
  std::vector<ScreenTriangle> triangles;
  for (const CellBlock& block : mesh.blocks)
    for (std::int64_t c = 0; c < block.size(); ++c) {
      const int n = vertex_count(block.type);
      Face face{{}, static_cast<std::uint8_t>(n), block.materials[c]};
      std::copy(block.cell(c), block.cell(c) + n, face.vertex.begin());
      const std::int32_t label = mesh.labels[face.material];
      constexpr Colour kPale{0.86F, 0.87F, 0.88F};
      add_face(
          face, [&](VertexId v) { return place(seen(v)); }, options.background == label ? kPale : label_colour(label),
          triangles);
    }
  return reduced(rasterise(triangles, 2 * width, 2 * height, 1.1F, execution), kTop, kTop, execution);
}

}  // namespace

template <int Dim>
void write_picture(const std::string& path, const Mesh<Dim>& mesh, const Frame<Dim>& frame,
                   const PictureOptions& options, const Execution& execution) {
  if (std::filesystem::path(path).extension() != ".png")
    throw Error(ErrorKind::usage, path + ": a picture is a PNG; give a name that ends in .png");
  write_png(path, options.overwrite, picture_of(mesh, frame, options, execution));
}

template void write_picture(const std::string&, const Mesh<2>&, const Frame<2>&, const PictureOptions&,
                            const Execution&);
template void write_picture(const std::string&, const Mesh<3>&, const Frame<3>&, const PictureOptions&,
                            const Execution&);

}  // namespace treemarch

/// \file
/// The whole way from a label image to a mesh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/field/field.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/borders.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/report/guarantee.h"
#include "treemarch/sizing/default_sizes.h"
#include "treemarch/sizing/sizing_rule.h"
#include "treemarch/smooth/shift.h"
#include "treemarch/tessellate/midpoint.h"

namespace treemarch {

/// The two complete ways through the stages (ARCHITECTURE.md), and references to compare them with
/// (docs/stages/references.md).
enum class Method {
  paper,           ///< midpoint tessellation and iterated marching simplices
  guaranteed,      ///< body-centred lattice and one cut for all materials, with a bound on the angles
  nielson_sung,    ///< reference: marching tetrahedra for two materials
  nielson_franke,  ///< reference: a label a vertex, cuts in the middle of edges, triangles and tetrahedra
  bonnell,         ///< reference: cuts where the largest of the material fractions at the vertices changes
  hege,            ///< reference: nielson_franke on sub-cells, two a cell and axis
};

/// What a mesh is made of.
enum class Elements {
  simplices,  ///< tetrahedra (2D: triangles) alone
  boxes,      ///< hexahedra (2D: quads) alone, as the voxels are; pyramids and simplices where sizes change
  hybrid,     ///< simplices at interfaces, hexahedra (2D: quads) where nothing is cut, pyramids between
};

/// The order in which the paper's method separates materials.
enum class MaterialOrder {
  largest,   ///< by the number of voxels, the largest first
  smallest,  ///< the same backwards
  label,     ///< by the labels of the file, the lowest first
  image,     ///< by first appearance
};

/// What a mesh should be like.
struct MeshOptions {
  Method method = Method::guaranteed;
  Elements elements = Elements::simplices;
  SizingRule sizes;                ///< completed where numbers are 0 (pipeline/sizes.h)
  Detail detail = Detail::normal;  ///< guaranteed method: the sizes where neither min_size nor a tolerance is given
  std::vector<double> weights;     ///< by material, for the majority in cells larger than a voxel; empty: all 1
  std::string pattern = "auto";    ///< refinement pattern, as parse_pattern() reads it
  int balance = 1;                 ///< difference of level over faces, edges and corners; kUnbalanced for no limit
  FacetRule facets = FacetRule::midpoint;  ///< paper's method: how facets with hanging nodes are divided
  std::optional<FieldKind> field;          ///< separating function; the method's own where it is not given
  std::optional<double> snap;              ///< fraction of an edge within which a vertex moves onto a surface; as field
  double shift = 0;                ///< boxes: vertices move onto interfaces by at most this part of a cell, below 0.5
  std::optional<int> smooth;       ///< smoothing steps; as field
  double sigma = kDefaultSigma;    ///< smoothing of the fields that smooth, in voxels along each axis
  double quality_floor = 18;       ///< guaranteed method: no quality (mesh/simplex_quality.h) below this after the cut
  double quality = 20;             ///< guaranteed method: improve elements below this; 0 leaves them as they were cut
  std::int64_t min_component = 8;  ///< guaranteed method: voxels of a component that must survive as one
  bool preserve_volume = false;    ///< guaranteed method: labels of 1,000 voxels or more keep their volume within 0.5 %
  bool closed_border = false;      ///< materials that touch the side of the image end there rounded, not cut off flat
  bool keep_background = false;    ///< whether cells of the background are part of the mesh
  std::int32_t background = 0;     ///< the label that means background
  /// Paper's method: the order in which materials are separated.
  MaterialOrder order = MaterialOrder::largest;
  /// Paper's method: materials that come before all others, in this order.
  std::vector<MaterialId> first;
};

/// A grey image of the same extent whose threshold is the end of the foreground.
template <int Dim>
struct GreyInput {
  GreyImage<Dim> image;
  double threshold = 0;
};

template <int Dim>
struct MeshResult {
  Mesh<Dim> mesh;
  std::optional<GuaranteeReport> guarantee;
  std::optional<ShiftReport> shift;
  std::optional<Borders> borders;  ///< of the mesh, if they were found on the way
  double seconds = 0;              ///< from the image in memory to the mesh in memory
};

/// Meshes an image; one of four dimensions (space and time) by Method::paper only. The times of the stages are in
/// `execution`. \param grey puts the end of the foreground where a grey value meets a threshold; may be null. \throw
/// Error(usage) for options that contradict each other or the image; Error(limits) for too large a mesh.
template <int Dim>
MeshResult<Dim> mesh_image(const LabelImage<Dim>& image, const MeshOptions& options, Execution& execution,
                           const GreyInput<Dim>* grey = nullptr);

}  // namespace treemarch

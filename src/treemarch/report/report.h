/// \file
/// What a user should know about a mesh: what it is made of, how good it is, what it cost.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/label_image.h"
#include "treemarch/mesh/mesh.h"
#include "treemarch/mesh/quality.h"
#include "treemarch/mesh/validate.h"
#include "treemarch/report/fidelity.h"
#include "treemarch/report/guarantee.h"
#include "treemarch/smooth/shift.h"

namespace treemarch {

/// What was taken from a label when the image was cleaned (pipeline/clean_up.h).
struct CleanedLabel {
  std::int32_t label = 0;
  std::int64_t components = 0, voxels = 0;
};

struct CleanUpReport {
  std::vector<CleanedLabel> islands;  ///< by label
  CleanedLabel holes;                 ///< of the background

  [[nodiscard]] bool empty() const { return islands.empty() && holes.components == 0; }
};

/// The report of one run.
struct Report {
  std::string version;                                       ///< of the library
  std::string image;                                         ///< file, as given
  std::string mesh;                                          ///< file, as given
  int dimension = 0;                                         ///< of the image
  std::vector<std::pair<std::string, std::string>> options;  ///< those that made the mesh, in the order of the program
  std::int64_t points = 0;
  std::vector<std::pair<CellType, std::int64_t>> cells;  ///< number by type, types that occur only
  MeshQuality quality;                                   ///< without cells where it was not measured
  Fidelity fidelity;
  struct Parts {
    std::int64_t count = 0, smallest = 0, largest = 0;      ///< parts, and cells in a part
    std::int64_t facets_between = 0, vertices_between = 0;  ///< that two or more parts share
  };
  std::optional<Parts> parts;                                   ///< of the mesh for parallel solvers
  std::vector<std::pair<std::string, std::int64_t>> node_sets;  ///< names and numbers of nodes
  std::optional<CleanUpReport> clean_up;                        ///< where it was asked for
  std::optional<GuaranteeReport> guarantee;                     ///< of the default method
  std::optional<ShiftReport> shift;                             ///< of hexahedral meshes
  std::optional<MeshDefects> defects;                           ///< where the mesh was examined
  std::vector<Execution::StageTime> seconds;                    ///< by stage
  double mesh_seconds = 0;                                      ///< from the image in memory to the mesh in memory
  std::int64_t peak_memory_bytes = 0;                           ///< of the whole process so far
  std::int64_t scratch_bytes = 0;                               ///< of a disk, for what exceeded a limit of memory
  std::vector<std::string> warnings;

  [[nodiscard]] std::int64_t cell_count() const {
    std::int64_t n = 0;
    for (const auto& c : cells) n += c.second;
    return n;
  }
};

/// Version of the library.
const char* version();

/// Name of a cell type in reports.
const char* name(CellType type);

/// Largest amount of memory that the process has held, in bytes.
std::int64_t peak_memory_bytes();

/// Fills what the mesh itself tells: dimension, points, cells.
template <int Dim>
void describe_mesh(const Mesh<Dim>& mesh, Report& report);

/// The report as JSON (documented in docs/report.md), indented, with a final newline.
std::string to_json(const Report& report);

enum class ReportLength : bool { brief, full };

/// The report for people: a few lines, what is out of the ordinary. Full: also tables of the labels, interfaces and
/// cells that are furthest from what they should be, the worst first, and the places where something is wrong.
std::string to_text(const Report& report, ReportLength length = ReportLength::brief);

}  // namespace treemarch

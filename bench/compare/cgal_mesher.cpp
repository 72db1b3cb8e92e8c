// cgal_mesher IMAGE MESH: meshes a label image with CGAL's Mesh_3, for bench/compare/compare only. CGAL Mesh_3 is under
// the GPL: this program is built on request, apart from the library, and is not installed.
//
// Prints one line of JSON: the time from the image in memory to CGAL's mesh in memory, and the memory held until then.
// The points that it writes have voxel centres at whole numbers.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Image_3.h>
#include <CGAL/Labeled_mesh_domain_3.h>
#include <CGAL/Mesh_3/initialize_triangulation_from_labeled_image.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/make_mesh_3.h>
#include <CGAL/refine_mesh_3.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "treemarch/core/execution.h"
#include "treemarch/image/read_image.h"
#include "treemarch/mesh/write_mesh.h"
#include "treemarch/report/report.h"

namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Domain = CGAL::Labeled_mesh_domain_3<Kernel>;
using treemarch::LabelImage;
using treemarch::MaterialId;
using treemarch::Mesh;

struct Options {
  std::string image, mesh;
  double cell = 2, facet = 2, distance = 0.5;  // voxels
  std::optional<double> threshold;
  std::int32_t background = 0;
  bool parallel = false, optimise = false;
  int threads = 2;
};

/// CGAL's image: 0 is not meshed, material m is m + 1.
CGAL::Image_3 cgal_image(const LabelImage<3>& image, std::int32_t background) {
  const auto& n = image.extent;
  const auto& s = image.frame.spacing;
  CGAL::Image_3 result(_createImage(n[0], n[1], n[2], 1, s[0], s[1], s[2], 2, WK_FIXED, SGN_UNSIGNED));
  auto* words = static_cast<std::uint16_t*>(result.data());
  for (std::int64_t i = 0; i < image.voxels.size(); ++i) {
    const MaterialId m = image.voxels[i];
    words[i] = image.labels[m] == background ? 0 : static_cast<std::uint16_t>(m + 1);
  }
  return result;
}

template <class C3t3>
Mesh<3> to_mesh(const C3t3& c3t3, const LabelImage<3>& image) {
  Mesh<3> mesh;
  mesh.labels = image.labels;
  mesh.names = image.names;
  std::unordered_map<typename C3t3::Vertex_handle, treemarch::VertexId> number;
  treemarch::CellBlock block;
  block.type = treemarch::CellType::tetrahedron;
  for (auto cell = c3t3.cells_in_complex_begin(); cell != c3t3.cells_in_complex_end(); ++cell) {
    for (int k = 0; k < 4; ++k) {
      const auto [at, fresh] =
          number.try_emplace(cell->vertex(k), static_cast<treemarch::VertexId>(mesh.points.size()));
      if (fresh) {
        const auto& p = cell->vertex(k)->point();
        mesh.points.push_back({});
        // Values of CGAL's images are at the corners of its lattice, ours are in the middle of the voxels.
        for (int d = 0; d < 3; ++d) mesh.points.back()[d] = p[d] + image.frame.spacing[d] / 2;
      }
      block.vertices.push_back(at->second);
    }
    block.materials.push_back(static_cast<MaterialId>(cell->subdomain_index() - 1));
  }
  mesh.blocks.push_back(std::move(block));
  return mesh;
}

/// Meshes and writes; returns what was measured.
template <class Concurrency>
void run(const LabelImage<3>& image, const Options& options, treemarch::Execution& execution) {
  using Triangulation = typename CGAL::Mesh_triangulation_3<Domain, CGAL::Default, Concurrency>::type;
  using C3t3 = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
  using Criteria = CGAL::Mesh_criteria_3<Triangulation>;
  namespace p = CGAL::parameters;

  const CGAL::Image_3 words = cgal_image(image, options.background);
  const auto& s = image.frame.spacing;
  const double voxel = std::min({s[0], s[1], s[2]});
  const auto start = std::chrono::steady_clock::now();
  const Domain domain = Domain::create_labeled_image_mesh_domain(words);
  const Criteria criteria(p::facet_angle = 30, p::facet_size = options.facet * voxel,
                          p::facet_distance = options.distance * voxel, p::cell_radius_edge_ratio = 3,
                          p::cell_size = options.cell * voxel);
  C3t3 c3t3;
  initialize_triangulation_from_labeled_image(c3t3, domain, words, criteria, std::uint16_t{});
  CGAL::refine_mesh_3(c3t3, domain, criteria, p::no_perturb(), p::no_exude());
  if (options.optimise) {
    CGAL::perturb_mesh_3(c3t3, domain);
    CGAL::exude_mesh_3(c3t3);
  }
  const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
  std::printf("{\"seconds\": %.4f, \"peak_memory_bytes\": %lld}\n", time.count(),
              static_cast<long long>(treemarch::peak_memory_bytes()));
  treemarch::WriteOptions how;
  how.overwrite = true;
  how.compress = false;
  how.space = treemarch::OutputSpace::index;
  treemarch::write_mesh(options.mesh, to_mesh(c3t3, image), image.frame, how, execution);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Meshes a label image with CGAL Mesh_3");
  Options o;
  app.add_option("IMAGE", o.image)->required();
  app.add_option("MESH", o.mesh)->required();
  app.add_option("--cell", o.cell, "Largest circumradius of cells, in voxels")->capture_default_str();
  app.add_option("--facet", o.facet, "Largest radius of interface facets, in voxels")->capture_default_str();
  app.add_option("--distance", o.distance, "Largest distance of facets to the interface, in voxels")
      ->capture_default_str();
  app.add_option("--threshold", o.threshold, "Label 1 from this value on");
  app.add_option("--background-label", o.background, "What is not meshed")->capture_default_str();
  app.add_option("--threads", o.threads)->capture_default_str();
  app.add_flag("--parallel", o.parallel, "CGAL's parallel mesher");
  app.add_flag("--optimise", o.optimise, "Perturb and exude slivers");
  CLI11_PARSE(app, argc, argv);
  std::cout.setstate(std::ios::failbit);  // CGAL reports its progress there
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, o.threads);
  try {
    treemarch::Execution execution;
    treemarch::ReadOptions reading;
    reading.threshold = o.threshold;
    const auto image = std::get<LabelImage<3>>(treemarch::read_label_image(o.image, reading, execution));
    if (o.parallel)
      run<CGAL::Parallel_tag>(image, o, execution);
    else
      run<CGAL::Sequential_tag>(image, o, execution);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cgal_mesher: %s\n", error.what());
    return 1;
  }
}

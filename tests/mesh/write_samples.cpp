// Writes small meshes with known contents in every format into the folder given, for other programs to read
// (read_samples.py).
#include <exception>
#include <filesystem>
#include <iostream>
#include <string>

#include "support/meshes.h"
#include "treemarch/mesh/interfaces.h"
#include "treemarch/mesh/write_mesh.h"

namespace {

using namespace treemarch;
using treemarch::testing::box_mesh;
using treemarch::testing::mixed_mesh;

constexpr std::int32_t kLargest = 2147483647;

/// Labels that are hard to keep, all in equal parts: see the same list in read_samples.py.
std::int32_t hard_label(int i) {
  constexpr std::int32_t kLabels[] = {0, -1, 70000, kLargest, 5, -kLargest - 1};
  return kLabels[i % 6];
}

template <int Dim>
void write_all(const std::filesystem::path& folder, const std::string& name, const Mesh<Dim>& mesh,
               const Frame<Dim>& frame, WriteOptions options = {}) {
  const Execution execution(2);
  options.overwrite = true;
  const auto facets = extract_interfaces(mesh, Hull::include, execution);
  for (const char* extension : {".vtu", ".msh", ".mesh"}) {
    write_mesh(folder / (name + extension), mesh, frame, options, execution);
    write_interfaces(folder / (name + "_interfaces" + extension), mesh, facets, frame, options, execution);
  }
}

Frame<3> oblique_left_handed() {
  Frame<3> frame;
  frame.spacing = {0.5, 0.5, 3};
  frame.direction = {Vec<3>{-0.6, 0.8, 0}, {0.8, 0.6, 0}, {0, 0, 1}};
  frame.origin = {10, -20, 1000.125};
  frame.space = "RAS";
  return frame;
}

void write_samples(const std::filesystem::path& folder) {
  Mesh<3> box = box_mesh<3>({6, 5, 4}, [](const Coord<3>& c) { return hard_label(c[0]); }, {0.5, 0.5, 3});
  Frame<3> thick;
  thick.spacing = {0.5, 0.5, 3};
  write_all(folder, "box", box, thick);
  write_all(folder, "left_handed", box, oblique_left_handed());
  write_all(folder, "plain", box, oblique_left_handed(), {.compress = false, .space = OutputSpace::index});
  box.names = {"", "with \"quotes\" & <signs>", "grey matter", "d\xc3\xa9j\xc3\xa0", "five", "last"};
  write_all(folder, "named", box, oblique_left_handed(), {.space = OutputSpace::lps});
  write_all<3>(folder, "mixed", mixed_mesh(), {});
  write_all<2>(folder, "flat", box_mesh<2>({6, 5}, [](const Coord<2>& c) { return hard_label(c[0]); }), {});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    std::filesystem::create_directories(argv[1]);
    write_samples(argv[1]);
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}

#include "treemarch/mesh/mesh_source.h"

#include <algorithm>
#include <charconv>

#include "treemarch/core/parallel.h"

namespace treemarch {

std::vector<std::uint64_t> write_chunks(OutputFile& file, const Execution& execution, std::int64_t n,
                                        std::int64_t chunk,
                                        const std::function<void(std::int64_t, std::int64_t, std::string&)>& make) {
  const std::int64_t count = block_count(n, chunk);
  std::vector<std::string> made(static_cast<std::size_t>(2 * execution.threads()));
  std::vector<std::uint64_t> sizes;
  parallel_in_order(
      execution, count, made.size(),
      [&](std::int64_t i, std::size_t slot) {
        made[slot].clear();
        make(i * chunk, std::min(n, (i + 1) * chunk), made[slot]);
      },
      [&](std::int64_t, std::size_t slot) {
        file.write(made[slot]);
        sizes.push_back(made[slot].size());
      });
  return sizes;
}

void append_number(std::string& text, double value) {
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

void append_number(std::string& text, std::int64_t value) {
  char digits[24];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

std::string describe_frame(const MeshSource& mesh, const std::string& prefix) {
  std::string text = prefix + "treemarch mesh\n";
  text += prefix + "space: " + (mesh.space.empty() ? "undeclared" : mesh.space) + "\n";
  text += prefix + "affine from voxel index to coordinates, row by row:";
  for (const double a : mesh.affine) {
    text += ' ';
    append_number(text, a);
  }
  text += "\n" + prefix + "outside label: " + std::to_string(mesh.outside) + "\n";
  for (std::size_t i = 0; i < mesh.names.size(); ++i)
    text += prefix + "label " + std::to_string(mesh.labels[i]) + ": " + mesh.names[i] + "\n";
  return text;
}

}  // namespace treemarch

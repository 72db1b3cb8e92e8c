#include "treemarch/mesh/mesh_source.h"

#include <algorithm>
#include <charconv>

#include "treemarch/core/parallel.h"

namespace treemarch {

std::vector<std::uint64_t> write_chunks(OutputFile& file, const Execution& execution, std::int64_t n,
                                        std::int64_t chunk,
                                        const std::function<void(std::int64_t, std::int64_t, std::string&)>& make) {
  const std::int64_t count = block_count(n, chunk);
  std::vector<std::string> batch(static_cast<std::size_t>(std::min<std::int64_t>(count, 2 * execution.threads())));
  std::vector<std::uint64_t> sizes;
  for (std::int64_t first = 0; first < count; first += static_cast<std::int64_t>(batch.size())) {
    const auto now = std::min<std::int64_t>(count - first, static_cast<std::int64_t>(batch.size()));
    parallel_for(execution, now, 1, [&](std::int64_t i) {
      const std::int64_t begin = (first + i) * chunk;
      batch[i].clear();
      make(begin, std::min(n, begin + chunk), batch[i]);
    });
    for (std::int64_t i = 0; i < now; ++i) {
      file.write(batch[i]);
      sizes.push_back(batch[i].size());
    }
  }
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

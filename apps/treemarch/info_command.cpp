// treemarch info IMAGE: geometry, labels, and what a mesh of it will cost.
#include <cstdio>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "image_options.h"
#include "memory_limit.h"
#include "options.h"
#include "terminal.h"
#include "treemarch/report/estimate.h"
#include "treemarch/topology/image_components.h"

namespace treemarch::app {
namespace {

struct InfoOptions {
  std::string image;
  ImageOptions reading;
  MemoryOptions memory;
  bool json = false;
  int threads = 0;
};

template <int Dim>
nlohmann::ordered_json describe(const std::string& path, const LabelImage<Dim>& image, const Execution& execution) {
  std::vector<std::int64_t> voxels(image.labels.size()), components(image.labels.size());
  for (const ImageComponent& c : image_components(image, execution)) {
    voxels[c.material] += c.voxels;
    ++components[c.material];
  }
  const MeshEstimate estimate = estimate_mesh(image, {}, false, execution);

  nlohmann::ordered_json json;
  json["image"] = path;
  json["dimension"] = Dim;
  json["extent"] = image.extent;
  json["spacing"] = image.frame.spacing;
  json["size"] = image.size();
  json["origin"] = image.frame.origin;
  json["direction"] = image.frame.direction;  // one column an axis
  json["space"] = image.frame.space;
  json["labels"] = nlohmann::ordered_json::array();
  std::vector<std::size_t> order(image.labels.size());
  for (std::size_t m = 0; m < order.size(); ++m) order[m] = m;
  std::ranges::sort(order, {}, [&](std::size_t m) { return image.labels[m]; });
  for (const std::size_t m : order) {
    json["labels"].push_back({{"label", image.labels[m]},
                              {"name", image.names.empty() ? "" : image.names[m]},
                              {"voxels", voxels[m]},
                              {"volume", static_cast<double>(voxels[m]) * image.voxel_volume()},
                              {"components", components[m]}});
  }
  json["interface_area"] = estimate.interface_area;
  json["estimated_cells"] = estimate.cells;
  json["estimated_memory_bytes"] = estimate.memory_bytes;
  return json;
}

std::string join(const nlohmann::ordered_json& numbers) {
  std::string text;
  char number[40];
  for (const auto& n : numbers) {
    std::snprintf(number, sizeof number, "%s%g", text.empty() ? "" : " x ", n.get<double>());
    text += number;
  }
  return text;
}

void print(const nlohmann::ordered_json& info) {
  const std::string space = info["space"].get<std::string>();
  std::printf("%s\n%dD, %s voxels of %s mm, %s mm in all, space %s\n", info["image"].get<std::string>().c_str(),
              info["dimension"].get<int>(), join(info["extent"]).c_str(), join(info["spacing"]).c_str(),
              join(info["size"]).c_str(), space.empty() ? "not declared" : space.c_str());
  std::printf("%zu labels\n%12s %12s %14s %10s  name\n", info["labels"].size(), "label", "voxels", "volume mm^d",
              "components");
  for (const auto& l : info["labels"]) {
    std::printf("%12d %12lld %14.6g %10lld  %s\n", l["label"].get<int>(), l["voxels"].get<long long>(),
                l["volume"].get<double>(), l["components"].get<long long>(), l["name"].get<std::string>().c_str());
  }
  std::printf("with one-voxel cells at interfaces about %.1f M cells, %.1f GB of memory\n",
              info["estimated_cells"].get<double>() / 1e6, info["estimated_memory_bytes"].get<double>() / 1e9);
}

void run(const InfoOptions& options) {
  if (const auto limit = memory_limit(options.memory, "")) apply(*limit);
  Execution execution(options.threads);
  Terminal terminal(execution, false);
  with_image(options.image, options.reading, execution, [&](auto image) {
    const auto info = describe(options.image, image, execution);
    if (options.json)
      std::printf("%s\n", info.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace).c_str());
    else
      print(info);
  });
}

}  // namespace

void add_info_command(CLI::App& app, Command& command) {
  const auto options = std::make_shared<InfoOptions>();
  CLI::App* info = app.add_subcommand("info", "Geometry and labels of an image, and what a mesh of it will cost");
  info->add_option("IMAGE", options->image, "Image file or folder of slices")->required();
  add_image_options(*info, options->reading);
  info->add_flag("--json", options->json, "Print JSON");
  add_threads_option(*info, options->threads);
  add_memory_options(*info, options->memory);
  info->callback([options, &command] { command = [options] { run(*options); }; });
}

}  // namespace treemarch::app

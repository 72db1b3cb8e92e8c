/// \file
/// Small options that several subcommands have, and how they are declared.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "treemarch/core/error.h"
#include "treemarch/mesh/output_frame.h"
#include "treemarch/report/report.h"

namespace treemarch::app {

/// Cells that a report lists as the worst.
inline constexpr int kWorstCells = 10;

/// An option of named values. Its text stays the name, so that reports and configurations show that.
template <class Value, class Target>
CLI::Option* add_choice(CLI::App& command, const std::string& name, Target& target,
                        const std::map<std::string, Value>& values, const std::string& description) {
  std::vector<std::string> names;
  names.reserve(values.size());
  for (const auto& v : values) names.push_back(v.first);
  return command
      .add_option_function<std::string>(
          name, [&target, values](const std::string& given) { target = values.at(given); }, description)
      ->check(CLI::IsMember(names).description(""))
      ->type_name(CLI::detail::join(names, "|"));
}

/// An option that may be given several times, with one text each.
inline CLI::Option* add_list(CLI::App& command, const std::string& name, std::vector<std::string>& target,
                             const std::string& description) {
  return command.add_option(name, target, description)->allow_extra_args(false)->type_name("TEXT");
}

inline void add_space_option(CLI::App& command, OutputSpace& space) {
  add_choice<OutputSpace>(command, "--space", space,
                          {{"file", OutputSpace::file},
                           {"ras", OutputSpace::ras},
                           {"lps", OutputSpace::lps},
                           {"index", OutputSpace::index}},
                          "Coordinates of the mesh: the world of the image file, RAS, LPS, or voxel indices")
      ->default_str("file");
}

inline void add_threads_option(CLI::App& command, int& threads) {
  command.add_option("--threads", threads, "Number of threads, 0 for all")->check(CLI::NonNegativeNumber);
}

inline void add_topology_options(CLI::App& command, std::int64_t& min_component, bool& strict) {
  command
      .add_option("--min-component", min_component, "Voxels from which a connected part of a label must stay one part")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_flag("--strict", strict, "Fail (exit code 5) where the topology of the image is not kept");
}

/// \throw Error(limits) if the mesh does not have the topology of its image
inline void require_topology(const Report& report, const std::string& what) {
  const auto& topology = report.fidelity.topology;
  if (topology && topology->breached())
    throw Error(ErrorKind::limits, what + ": --strict: " + topology->breach() + "; choose a smaller --min-size");
}

}  // namespace treemarch::app

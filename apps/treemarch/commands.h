/// \file
/// The subcommands of the program. Each adds itself to the parser and, when it is asked for, sets what is to be run.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace treemarch::app {

/// Runs after all options have been read; throws Error for what a user can mend.
using Command = std::function<void()>;

void add_mesh_command(CLI::App& app, Command& command);
void add_info_command(CLI::App& app, Command& command);
void add_check_command(CLI::App& app, Command& command);
void add_slice_command(CLI::App& app, Command& command);

}  // namespace treemarch::app

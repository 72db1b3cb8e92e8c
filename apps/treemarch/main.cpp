// The program `treemarch`: reads the command line, runs a subcommand, turns errors into one line and an exit code.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "commands.h"
#include "memory_limit.h"
#include "treemarch/core/error.h"
#include "treemarch/report/report.h"

namespace {

constexpr int kInterrupted = 130;
constexpr int kInternal = 1;

int fail(std::string message, int code) {
  std::ranges::replace(message, '\n', ' ');
  std::fprintf(stderr, "treemarch: error: %s\n", message.c_str());
  return code;
}

int run(const treemarch::app::Command& command) {
  using treemarch::ErrorKind;
  try {
    command();
    return 0;
  } catch (const treemarch::Error& e) {
    return fail(e.what(), static_cast<int>(e.kind()));
  } catch (const treemarch::Cancelled&) {
    return fail("interrupted; nothing was written", kInterrupted);
  } catch (const std::bad_alloc&) {
    if (treemarch::app::is_scratch_full())
      return fail("--scratch: the disk has no room for what exceeds --max-memory; name another folder",
                  static_cast<int>(ErrorKind::limits));
    return fail("out of memory; choose larger cells (--min-size) or a part of the image (--roi)",
                static_cast<int>(ErrorKind::limits));
  } catch (const std::exception& e) {
    return fail(std::string("internal: ") + e.what(), kInternal);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // writing beyond a limit of files (ulimit -f) fails instead
  CLI::App app{"Finite-element meshes from segmented images"};
  app.name("treemarch");
  app.set_version_flag("--version", treemarch::version());
  app.require_subcommand(1);
  app.set_config("--config", "", "Options from a file, as --dump-config prints them; those of the command line win");
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.failure_message([](const CLI::App*, const CLI::Error& e) { return std::string(e.what()); });

  treemarch::app::Command command;
  treemarch::app::add_mesh_command(app, command);
  treemarch::app::add_info_command(app, command);
  treemarch::app::add_check_command(app, command);
  treemarch::app::add_slice_command(app, command);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // help and version
    return fail(std::string(e.what()) + "; see treemarch --help", static_cast<int>(treemarch::ErrorKind::usage));
  }
  return run(command);
}

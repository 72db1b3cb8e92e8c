// The program `treemarch`: one file per subcommand, this one joins them.
#include <CLI/CLI.hpp>

int main(int argc, char** argv) {
  CLI::App app{"Finite-element meshes from labelled images"};
  app.require_subcommand(1);
  CLI11_PARSE(app, argc, argv);
  return 0;
}

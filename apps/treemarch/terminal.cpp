#include "terminal.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>

namespace treemarch::app {
namespace {

std::atomic<Execution*> running{nullptr};

void on_interrupt(int signal) {
  std::signal(signal, SIG_DFL);
  if (Execution* execution = running.load()) execution->cancel();
}

}  // namespace

Terminal::Terminal(Execution& execution, bool quiet) : execution_(execution) {
  execution.on_warning = [this, quiet](std::string_view message) {
    warnings_.emplace_back(message);
    if (quiet) return;
    clear_line();
    std::fprintf(stderr, "treemarch: warning: %s\n", warnings_.back().c_str());
  };
  if (!quiet && ::isatty(STDERR_FILENO)) {
    execution.on_progress = [this](std::string_view stage, double fraction) {
      std::string line(stage);
      line += " " + std::to_string(static_cast<int>(100 * fraction)) + " %";
      if (line == shown_) return;
      clear_line();
      std::fputs(line.c_str(), stderr);
      shown_ = std::move(line);
    };
  }
  running = &execution;
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
}

Terminal::~Terminal() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  running = nullptr;
  clear_line();
  execution_.on_warning = nullptr;
  execution_.on_progress = nullptr;
}

void Terminal::clear_line() {
  if (shown_.empty()) return;
  std::fprintf(stderr, "\r%*s\r", static_cast<int>(shown_.size()), "");
  shown_.clear();
}

}  // namespace treemarch::app

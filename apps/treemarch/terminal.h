/// \file
/// The side of a run that a user sees while it lasts.
#pragma once

#include <string>
#include <vector>

#include "treemarch/core/execution.h"

namespace treemarch::app {

/// Connects an Execution to the terminal while the object lives: progress on stderr if that is a terminal, warnings on
/// stderr, and Ctrl-C (a second one ends the program at once).
class Terminal {
 public:
  Terminal(Execution& execution, bool quiet);
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// All warnings so far, in their order.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  void clear_line();

  Execution& execution_;
  std::vector<std::string> warnings_;
  std::string shown_;  ///< the progress line on the screen
};

}  // namespace treemarch::app

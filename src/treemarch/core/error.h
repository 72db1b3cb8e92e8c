/// \file
/// Errors that a user can mend. Each is one line: the file or option, what is wrong, what to do.
#pragma once

#include <stdexcept>
#include <string>

namespace treemarch {

/// Classes of errors; the value is the exit code of the program.
enum class ErrorKind : int {
  usage = 2,   ///< an option or a combination of options
  input = 3,   ///< a file that is missing, damaged or not what it should be
  output = 4,  ///< a file that cannot be written
  limits = 5,  ///< too large, or a contract that cannot be kept
};

class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  [[nodiscard]] ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

/// Thrown by Execution::check() after a request to stop.
class Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("interrupted") {}
};

}  // namespace treemarch

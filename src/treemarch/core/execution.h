/// \file
/// What a stage needs from its surroundings: threads, progress, cancellation, and a place for timings.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace treemarch {

/// One object that is passed through all stages. Not copyable; one pipeline at a time uses it.
class Execution {
 public:
  /// \param threads number of threads, 0 for all that the machine has.
  explicit Execution(int threads = 0);
  ~Execution();
  Execution(const Execution&) = delete;
  Execution& operator=(const Execution&) = delete;

  [[nodiscard]] int threads() const;

  /// Called from the thread that runs the pipeline: name of the stage and the fraction done in [0, 1].
  std::function<void(std::string_view stage, double fraction)> on_progress;
  /// Called with things that a user should know but that stop nothing, one line each.
  std::function<void(std::string_view message)> on_warning;

  /// Asks the running stage to stop; it then throws Cancelled. Safe in a signal handler and from any thread.
  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  /// \throw Cancelled after cancel().
  void check() const;
  void progress(double fraction) const;
  void warn(std::string_view message) const;

  struct StageTime {
    std::string name;
    double seconds;
  };
  /// Wall-clock seconds of the stages that have ended, in order.
  [[nodiscard]] const std::vector<StageTime>& stage_times() const { return times_; }

  /// Names and times the stage that runs while the object lives.
  class Stage {
   public:
    Stage(Execution& execution, std::string_view name);
    ~Stage();
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

   private:
    Execution& execution_;
    std::string outer_;
    std::chrono::steady_clock::time_point start_;
  };

  /// Runs `work` inside the thread pool of this object (used by core/parallel.h only).
  void run(const std::function<void()>& work) const;

 private:
  struct Pool;
  std::unique_ptr<Pool> pool_;
  std::atomic<bool> cancelled_{false};
  std::string stage_;
  std::vector<StageTime> times_;
};

}  // namespace treemarch

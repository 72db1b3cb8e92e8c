#include "treemarch/core/execution.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "treemarch/core/error.h"

namespace treemarch {

struct Execution::Pool {
  explicit Pool(int threads)
      : limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads)), arena(threads) {}
  tbb::global_control limit;
  tbb::task_arena arena;
};

Execution::Execution(int threads)
    : pool_(std::make_unique<Pool>(threads > 0 ? threads : tbb::this_task_arena::max_concurrency())) {}

Execution::~Execution() = default;

int Execution::threads() const { return pool_->arena.max_concurrency(); }

void Execution::check() const {
  if (cancelled_.load(std::memory_order_relaxed)) throw Cancelled();
}

void Execution::progress(double fraction) const {
  check();
  if (on_progress) on_progress(stage_, fraction);
}

void Execution::warn(std::string_view message) const {
  if (on_warning) on_warning(message);
}

void Execution::run(const std::function<void()>& work) const { pool_->arena.execute(work); }

Execution::Stage::Stage(Execution& execution, std::string_view name)
    : execution_(execution), outer_(std::move(execution.stage_)), start_(std::chrono::steady_clock::now()) {
  execution_.stage_ = name;
  execution_.progress(0);
}

Execution::Stage::~Stage() {
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
  execution_.times_.push_back({execution_.stage_, elapsed.count()});
  execution_.stage_ = std::move(outer_);
}

}  // namespace treemarch

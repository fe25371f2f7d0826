#include "pipeline/flow/layers.h"

#include <tbb/flow_graph.h>
#include <tbb/global_control.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <new>
#include <set>

#include "pipeline/flow/budget.h"
#include "stages/support/clocks.h"

namespace lamina::pipeline {
namespace {

using Clock = std::chrono::steady_clock;

namespace flow = tbb::flow;
using Node = flow::function_node<flow::continue_msg, flow::continue_msg>;

/// Layers in flight, their loans, and the graph, a node each step. The library starts the newest message of a node first, and
/// whoever sends may have to wait for memory: so a message is a turn and names no layer, it is sent once a layer may go on,
/// and the node takes the oldest layer that waits for its step. Later steps go before earlier ones. The library copies node
/// bodies, which refer to this object, so its address must not change.
class LayerFlow {
 public:
  LayerFlow(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel)
      : count_(count),
        steps_(steps),
        cancel_(cancel),
        budget_(limits.budget_bytes, limits.most_in_flight, {steps.bytes_held, steps.let_go}),
        moving_(limits.record_slots),
        times_processor_(limits.processor_times),
        ready_(steps.steps.size()),
        step_ns_(steps.steps.size() + 1),
        step_processor_ns_(steps.steps.size() + 1) {
    for (std::size_t s = 0; s < steps.steps.size(); ++s) {
      nodes_.push_back(std::make_unique<Node>(
          graph_, flow::unlimited, [this, s](const flow::continue_msg&) { return take_turn(s); },
          static_cast<flow::node_priority_t>(s + 1)));
    }
  }

  Status run() {
    {
      const std::lock_guard lock(mutex_);
      admit();
    }
    graph_.wait_for_all();
    if (result_ && next_ < count_) return Error{Fault::kInterrupted, "interrupted"};
    return result_;
  }

  FlowReport report() const {
    FlowReport report{budget_.most_in_flight(), budget_.most_bytes(), oversized_, {}, {}, static_cast<double>(lock_ns_) * 1e-9};
    for (std::size_t s = 0; s < step_ns_.size(); ++s) {
      const bool is_record = s == steps_.steps.size();
      report.step_seconds.emplace_back(is_record ? "record" : steps_.steps[s].name, static_cast<double>(step_ns_[s]) * 1e-9);
      report.step_processor_seconds.push_back(static_cast<double>(step_processor_ns_[s]) * 1e-9);
    }
    return report;
  }

 private:
  /// A layer begun and not recorded. Only the thread that takes its step touches it, and under the lock whoever decides
  /// about a layer that waits.
  struct Moving {
    Ticket ticket;
    Status status;
    Budget::Loan loan;
    std::uint64_t estimate = 0, more = 0, held = 0;  // at its admission; from its gate on; the most so far
    std::size_t step = 0;
    bool asked = false;     // what the step needs is known
    bool finished = false;  // all steps are taken
  };
  Moving& at(std::uint32_t position) { return moving_[position % moving_.size()]; }

  // --- under the lock

  /// Gives the node of a layer's step a turn.
  void send(const Moving& moving) {
    ready_[moving.step].insert(moving.ticket.position);
    nodes_[moving.step]->try_put({});
  }

  void admit() {
    for (;;) {
      stopped_ |= cancel_.load(std::memory_order_relaxed);
      if (stopped_ || next_ == count_ || next_ - recorded_ == moving_.size()) return;
      const std::uint64_t estimate = steps_.bytes_of(next_);
      const auto loan = budget_.take(admission_(estimate));
      if (!loan) return;
      const auto slot = static_cast<std::uint32_t>(next_ % moving_.size());
      moving_[slot] = {{next_, loan->slot, slot}, {}, *loan, estimate};
      ++next_;
      send(moving_[slot]);
    }
  }

  /// Whether a layer may take its next step now; raises its loan to what the step needs.
  bool may_go(Moving& moving) {
    const bool next_to_record = moving.ticket.position == recorded_;
    std::uint64_t bytes = moving.loan.bytes;
    if (moving.asked) bytes = std::max(moving.held, whole_(moving.estimate + moving.more));
    const std::uint64_t added = bytes > moving.loan.bytes ? bytes - moving.loan.bytes : 0;
    if (!next_to_record && moving.status && !budget_.fits(added)) return false;
    if (moving.asked && moving.status) budget_.settle(moving.loan, bytes);
    return true;
  }

  /// Lets waiting layers go on, the oldest first. None that needs more overtakes an older one that does.
  void wake() {
    bool held_up = false;
    for (auto position = waiting_.begin(); position != waiting_.end();) {
      Moving& moving = at(*position);
      if ((held_up && moving.asked) || !may_go(moving)) {
        held_up = true;
        ++position;
        continue;
      }
      send(moving);
      position = waiting_.erase(position);
    }
  }

  /// What cannot be recorded any more is not made.
  void begin_turn(Moving& moving) const {
    if (moving.status && failed_) moving.status = Error{Fault::kInterrupted, "interrupted"};
  }

  /// After a step that did not finish the layer. returns  whether this thread takes the next one, too: its turn would be the
  /// first, and the graph takes longer to say so than some steps take
  bool go_on(Moving& moving) {
    if (moving.held > moving.loan.bytes) budget_.settle(moving.loan, moving.held);
    bool first = waiting_.empty();
    for (std::size_t s = moving.step; first && s < ready_.size(); ++s) first = ready_[s].empty();
    if (first && may_go(moving)) {
      begin_turn(moving);
      return true;
    }
    waiting_.insert(moving.ticket.position);
    wake();
    return false;
  }

  void leave(Moving& moving) {
    if (moving.status) {
      admission_.learn(moving.estimate, moving.held);
      whole_.learn(moving.estimate + moving.more, moving.held);
      oversized_ += moving.held > budget_.bytes() ? 1 : 0;
    }
    if (!steps_.records_from_work) {
      budget_.give_back(moving.loan, held_now(moving));
    } else {
      budget_.settle(moving.loan, held_now(moving));
    }
    moving.finished = true;
  }

  // --- without the lock

  std::uint64_t held_now(const Moving& moving) const { return steps_.bytes_held(moving.ticket.work); }

  /// Takes the lock, and counts the time until it has it.
  std::unique_lock<std::mutex> lock() {
    std::unique_lock held(mutex_, std::try_to_lock);
    if (held) return held;
    const auto start = Clock::now();
    held.lock();
    lock_ns_ += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start).count();
    return held;
  }

  flow::continue_msg take_turn(std::size_t s) {
    Moving* moving = nullptr;
    {
      const auto held = lock();
      moving = &at(*ready_[s].begin());
      ready_[s].erase(ready_[s].begin());
      begin_turn(*moving);
    }
    while (take_step(*moving)) {
    }
    return {};
  }

  /// returns  whether this thread takes the layer's next step
  bool take_step(Moving& moving) {
    const Step& step = steps_.steps[moving.step];
    if (moving.status && given_up()) moving.status = Error{Fault::kInterrupted, "interrupted"};
    const Turn turn{Clock::now(), processor_seconds()};
    if (step.needs && !moving.asked) {
      if (moving.status) ask(step, moving);
      moving.asked = true;
      count_time(moving.step, turn);
      const auto held = lock();
      return go_on(moving);
    }
    if (moving.status) moving.status = guarded([&] { return step.run(moving.ticket); });
    count_time(moving.step, turn);
    moving.held = std::max(moving.held, held_now(moving));
    std::unique_lock held = lock();
    if (moving.status && ++moving.step < steps_.steps.size()) {
      moving.asked = false;
      return go_on(moving);
    }
    leave(moving);
    record(held);
    wake();
    admit();
    return false;
  }

  void ask(const Step& step, Moving& moving) {
    moving.status = guarded([&]() -> Status {
      const Result<std::uint64_t> more = step.needs(moving.ticket);
      if (!more) return more.error();
      moving.more = *more;
      return {};
    });
    moving.held = std::max(moving.held, held_now(moving));
  }

  /// Records all finished layers that are next; one thread at a time. The lock is released while it records.
  void record(std::unique_lock<std::mutex>& held) {
    if (recording_) return;
    recording_ = true;
    while (recorded_ < next_ && at(recorded_).finished) {
      Moving& moving = at(recorded_);
      held.unlock();
      if (result_) {  // otherwise an earlier layer failed, and this one is not recorded
        const Turn turn{Clock::now(), processor_seconds()};
        result_ = moving.status ? guarded([&] { return steps_.record(moving.ticket); }) : moving.status;
        count_time(steps_.steps.size(), turn);
      }
      const std::uint64_t retained = steps_.records_from_work ? held_now(moving) : 0;
      const std::uint64_t beside = steps_.bytes_beside ? steps_.bytes_beside() : 0;
      held = lock();
      budget_.hold_beside(beside);
      if (steps_.records_from_work) budget_.give_back(moving.loan, retained);
      moving.finished = false;
      ++recorded_;
      failed_ |= !result_;
      stopped_ |= failed_;
      wake();
      admit();
    }
    recording_ = false;
  }

  template <class Act>
  static Status guarded(Act&& act) {
    try {
      return act();
    } catch (const std::bad_alloc&) {
      return out_of_memory();
    }
  }

  /// Whether layers in flight are to be left: some time after the flow was told to stop.
  bool given_up() {
    if (!cancel_.load(std::memory_order_relaxed)) return false;
    std::int64_t never = 0;
    const std::int64_t now = Clock::now().time_since_epoch().count();
    told_at_.compare_exchange_strong(never, now);
    return Clock::duration(now - told_at_.load()) > kPatience;
  }

  /// A step of one layer, from here on.
  struct Turn {
    Clock::time_point start;
    double processor = 0;
  };
  double processor_seconds() const { return times_processor_ ? thread_seconds() : 0; }
  void count_time(std::size_t step, const Turn& turn) {
    step_ns_[step] += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - turn.start).count();
    step_processor_ns_[step] += static_cast<std::int64_t>(1e9 * (processor_seconds() - turn.processor));
  }

  static constexpr std::chrono::milliseconds kPatience{300};
  const std::uint32_t count_;
  const LayerSteps& steps_;
  const std::atomic<bool>& cancel_;
  std::atomic<std::int64_t> told_at_{0};

  std::mutex mutex_;  // guards the following members up to the times
  Budget budget_;
  Correction admission_, whole_;  // of the estimates before and after a gate
  std::vector<Moving> moving_;    // by position, round and round
  const bool times_processor_;
  std::vector<std::set<std::uint32_t>> ready_;  // positions, by step: one turn each is on its way
  std::set<std::uint32_t> waiting_;             // for bytes
  std::uint32_t next_ = 0;                      // position of the next layer to admit
  std::uint32_t recorded_ = 0, oversized_ = 0;
  bool recording_ = false, stopped_ = false;  // stopped: no further admissions
  bool failed_ = false;                       // an earlier layer is not on record, so no later one can be

  std::vector<std::atomic<std::int64_t>> step_ns_, step_processor_ns_;  // of each step, and of recording
  std::atomic<std::int64_t> lock_ns_{0};
  Status result_;  // of `record`, which runs once at a time

  flow::graph graph_;
  std::vector<std::unique_ptr<Node>> nodes_;  // of each step
};

}  // namespace

Status flow_layers(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel,
                   FlowReport& report) {
  LayerFlow layers(count, steps, limits, cancel);
  const Status status = layers.run();
  report = layers.report();
  return status;
}

std::uint32_t layers_in_flight() {
  return 2 * static_cast<std::uint32_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

}  // namespace lamina::pipeline

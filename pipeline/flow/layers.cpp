#include "pipeline/flow/layers.h"

#include <tbb/flow_graph.h>
#include <tbb/global_control.h>

#include <chrono>
#include <map>
#include <memory>
#include <mutex>

#include "pipeline/flow/budget.h"

namespace lamina::pipeline {
namespace {

namespace flow = tbb::flow;
using Node = flow::function_node<Ticket, Ticket>;
using End = flow::function_node<Ticket, flow::continue_msg>;

/// The steps as nodes of a graph, and the loans of layers in flight. The library copies node bodies, which refer to this
/// object, so its address must not change.
class LayerGraph {
 public:
  LayerGraph(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel)
      : count_(count),
        steps_(steps),
        limits_(limits),
        cancel_(cancel),
        budget_(limits.budget_bytes, limits.most_in_flight, {steps.bytes_held, steps.let_go}),
        moving_(limits.record_slots),
        step_ns_(steps.steps.size() + 1) {
    for (std::uint32_t slot = limits.record_slots; slot-- > 0;) free_records_.push_back(slot);
    connect();
  }

  Status run() {
    admit();
    graph_.wait_for_all();
    if (result_ && next_ < count_) return Error{Fault::kInterrupted, "interrupted"};
    return result_;
  }

  FlowReport report() const {
    FlowReport report{budget_.most_in_flight(), budget_.most_bytes(), {}};
    for (std::size_t s = 0; s < step_ns_.size(); ++s) {
      const bool is_record = s == steps_.steps.size();
      report.step_seconds.emplace_back(is_record ? "record" : steps_.steps[s].name, static_cast<double>(step_ns_[s]) * 1e-9);
    }
    return report;
  }

 private:
  /// An admitted layer before it is recorded; indexed by record slot.
  struct Moving {
    Status status;
    Budget::Loan loan;
    std::uint64_t more = 0;  // bytes that it waits for at a gate
  };

  void connect() {
    flow::sequencer_node<Ticket>& in_order = in_order_;
    for (std::size_t s = 0; s < steps_.steps.size(); ++s) {
      if (steps_.steps[s].needs) {
        gated_ = s;
        gate_ = std::make_unique<End>(graph_, flow::unlimited, [this](const Ticket& ticket) { return wait_at_gate(ticket); });
        if (s > 0) flow::make_edge(*nodes_.back(), *gate_);
      }
      nodes_.push_back(std::make_unique<Node>(graph_, flow::unlimited, [this, s](const Ticket& ticket) {
        take_step(s, ticket);
        if (s + 1 == steps_.steps.size()) leave(ticket);
        return ticket;
      }));
      if (s > 0 && !steps_.steps[s].needs) flow::make_edge(*nodes_[s - 1], *nodes_[s]);
    }
    flow::make_edge(*nodes_.back(), in_order);
    flow::make_edge(in_order, record_);
  }

  void admit() {
    for (;;) {
      Ticket ticket;
      {
        const std::lock_guard lock(mutex_);
        stopped_ |= cancel_.load(std::memory_order_relaxed);
        if (stopped_ || next_ == count_ || free_records_.empty()) return;
        const auto loan = budget_.take(steps_.bytes_of(next_));
        if (!loan) return;
        ticket = {next_++, loan->slot, free_records_.back()};
        free_records_.pop_back();
        moving_[ticket.record] = {Status(), *loan, 0};
      }
      if (gate_ && gated_ == 0) {
        gate_->try_put(ticket);
      } else {
        nodes_.front()->try_put(ticket);
      }
    }
  }

  void take_step(std::size_t step, const Ticket& ticket) {
    Status& status = moving_[ticket.record].status;
    if (!status) return;
    const auto start = Clock::now();
    status = steps_.steps[step].run(ticket);
    count_time(step, start);
  }

  flow::continue_msg wait_at_gate(const Ticket& ticket) {
    Moving& moving = moving_[ticket.record];
    if (moving.status) {
      const auto start = Clock::now();
      const Result<std::uint64_t> more = steps_.steps[gated_].needs(ticket);
      count_time(gated_, start);
      moving.more = more ? *more : 0;
      if (!more) moving.status = more.error();
    }
    {
      const std::lock_guard lock(mutex_);
      at_gate_.emplace(ticket.position, ticket);
    }
    open_gate();
    return {};
  }

  void open_gate() {
    for (;;) {
      Ticket ticket;
      {
        const std::lock_guard lock(mutex_);
        const auto found = at_gate_.find(next_at_gate_);
        if (found == at_gate_.end()) return;
        ticket = found->second;
        Moving& moving = moving_[ticket.record];
        if (next_at_gate_ != recorded_ && !budget_.fits(moving.more)) return;
        at_gate_.erase(found);
        ++next_at_gate_;
        budget_.add(moving.more);
        moving.loan.bytes += moving.more;
      }
      nodes_[gated_]->try_put(ticket);
    }
  }

  /// After the last step: sets the bytes that the layer holds from here on.
  void leave(const Ticket& ticket) {
    {
      const std::lock_guard lock(mutex_);
      Budget::Loan& loan = moving_[ticket.record].loan;
      if (steps_.records_from_work) {
        const std::uint64_t held = steps_.bytes_held(ticket.work);
        budget_.settle(loan.bytes, held);
        loan.bytes = held;
        return;
      }
      budget_.give_back(loan);
    }
    after_room_was_given_back();
  }

  flow::continue_msg record(const Ticket& ticket) {
    Moving& moving = moving_[ticket.record];
    if (result_) {  // otherwise an earlier layer failed, and this one is not recorded
      const auto start = Clock::now();
      result_ = moving.status ? steps_.record(ticket) : moving.status;
      count_time(steps_.steps.size(), start);
    }
    {
      const std::lock_guard lock(mutex_);
      if (steps_.records_from_work) budget_.give_back(moving.loan);
      free_records_.push_back(ticket.record);
      ++recorded_;
      stopped_ |= !result_;
    }
    after_room_was_given_back();
    return {};
  }

  void after_room_was_given_back() {
    if (gate_) open_gate();
    admit();
  }

  using Clock = std::chrono::steady_clock;
  void count_time(std::size_t step, Clock::time_point start) {
    step_ns_[step] += std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now() - start).count();
  }

  const std::uint32_t count_;
  const LayerSteps& steps_;
  const FlowLimits& limits_;
  const std::atomic<bool>& cancel_;

  std::mutex mutex_;  // guards the following members up to the nodes
  Budget budget_;
  std::vector<std::uint32_t> free_records_;
  std::map<std::uint32_t, Ticket> at_gate_;  // by position
  std::uint32_t next_ = 0;                   // position of the next layer to admit
  std::uint32_t next_at_gate_ = 0;
  std::uint32_t recorded_ = 0;
  bool stopped_ = false;  // no further admissions

  std::vector<Moving> moving_;                      // a slot belongs to one layer through all steps
  std::vector<std::atomic<std::int64_t>> step_ns_;  // of each step, and of recording
  Status result_;                                   // of `record`, which runs once at a time

  flow::graph graph_;
  std::vector<std::unique_ptr<Node>> nodes_;
  std::unique_ptr<End> gate_;
  std::size_t gated_ = 0;
  flow::sequencer_node<Ticket> in_order_{graph_, [](const Ticket& ticket) -> std::size_t { return ticket.position; }};
  End record_{graph_, flow::serial, [this](const Ticket& ticket) { return record(ticket); }};
};

}  // namespace

Status flow_layers(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel,
                   FlowReport& report) {
  LayerGraph graph(count, steps, limits, cancel);
  const Status status = graph.run();
  report = graph.report();
  return status;
}

std::uint32_t layers_in_flight() {
  return 2 * static_cast<std::uint32_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
}

}  // namespace lamina::pipeline

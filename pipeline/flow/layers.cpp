#include "pipeline/flow/layers.h"

#include <tbb/flow_graph.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <new>
#include <tuple>

#include "pipeline/flow/credits.h"
#include "stages/support/clocks.h"

namespace lamina::pipeline {
namespace {

namespace flow = tbb::flow;
using Clock = std::chrono::steady_clock;
using Phase = LayerState::Phase;

Error interrupted() { return {Fault::kInterrupted, "interrupted"}; }

std::size_t threads() { return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism); }

constexpr std::uint32_t kAllDecided = UINT32_MAX;  // position of the message that says so

struct LayerMessage {
  LayerState* layer = nullptr;  // null until it is begun
  std::uint32_t position = 0;
  std::uint32_t step = 0;   // to be taken next
  bool to_credits = false;  // before that step
  friend bool operator>(const LayerMessage& a, const LayerMessage& b) { return a.position > b.position; }
};

/// When layers are to be left.
class StopSignal {
 public:
  explicit StopSignal(const std::atomic<bool>& cancel) : cancel_(cancel) {}

  void fail() { failed_.store(true, std::memory_order_relaxed); }
  /// Whether no further layer is begun.
  bool stopped() const { return failed() || cancel_.load(std::memory_order_relaxed); }
  /// Whether layers in flight take no further step: they cannot be recorded, or have had their time since the cancellation.
  bool gives_up() {
    if (failed()) return true;
    if (!cancel_.load(std::memory_order_relaxed)) return false;
    std::int64_t never = 0;
    const std::int64_t now = Clock::now().time_since_epoch().count();
    cancelled_at_.compare_exchange_strong(never, now);
    return Clock::duration(now - cancelled_at_.load()) > kPatience;
  }

 private:
  static constexpr std::chrono::milliseconds kPatience{300};
  bool failed() const { return failed_.load(std::memory_order_relaxed); }
  const std::atomic<bool>& cancel_;
  std::atomic<bool> failed_{false};  // an earlier layer is not on record, so no later one can be
  std::atomic<std::int64_t> cancelled_at_{0};
};

template <class Act>
Status timed(BusyClock& clock, Act&& act) {
  try {
    return clock.time(act);
  } catch (const std::bad_alloc&) {
    return out_of_memory();
  }
}

/// The graph that layers.h draws. Its nodes refer to this object.
class LayerFlow {
 public:
  LayerFlow(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel)
      : count_(count),
        steps_(steps),
        stop_(cancel),
        credits_(steps, limits, is_stopped_),
        heights_clock_(limits.processor_times),
        credits_clock_(limits.processor_times),
        record_clock_(limits.processor_times),
        heights_(graph_, [this](tbb::flow_control& control) { return next_layer(control); }),
        decided_(graph_, flow::unlimited,
                 [](const LayerMessage& message, Gate::output_ports_type& ports) noexcept {
                   (message.position == kAllDecided ? std::get<1>(ports) : std::get<0>(ports)).try_put(message);
                 }),
        backlog_(graph_),
        slots_(graph_, limits.record_slots),
        credits_node_(graph_, flow::serial, [this](const LayerMessage& message, auto& ports) { lend(message, ports); }),
        order_(graph_,
               [first = steps.decide ? 1u : 0u](const LayerMessage& message) { return std::size_t{message.position + first}; }),
        record_(graph_, flow::serial, [this](const LayerMessage& message) { return record(message); }) {
    for (std::uint32_t s = 0; s < steps.steps.size(); ++s) nodes_.push_back(std::make_unique<StepNodes>(*this, s, limits));
    make_edges();
  }

  Status run() {
    heights_.activate();
    graph_.wait_for_all();
    if (result_ && !all_sent_) return interrupted();
    return result_;
  }

  FlowReport report() const {
    FlowReport report{credits_.budget().max_in_flight(), credits_.budget().max_bytes(), credits_.oversized()};
    if (steps_.decide) report.nodes.push_back({"heights", heights_clock_.total()});
    report.nodes.push_back({"credits", credits_clock_.total()});
    for (std::size_t s = 0; s < nodes_.size(); ++s) report.nodes.push_back({steps_.steps[s].name, nodes_[s]->clock.total()});
    report.nodes.push_back({"record", record_clock_.total()});
    return report;
  }

 private:
  using CreditsNode = flow::multifunction_node<LayerMessage, std::tuple<LayerMessage, LayerMessage, flow::continue_msg>>;
  using Gate = flow::multifunction_node<LayerMessage, std::tuple<LayerMessage, LayerMessage>, flow::queueing_lightweight>;

  /// A step with what leads to it. `credits` sends to all gates; each passes on what is for its step.
  struct StepNodes {
    BusyClock clock;
    Gate gate;
    flow::priority_queue_node<LayerMessage, std::greater<>> queue;  // the oldest first
    flow::function_node<LayerMessage, LayerMessage, flow::rejecting> step;

    StepNodes(LayerFlow& flow, std::uint32_t s, const FlowLimits& limits)
        : clock(limits.processor_times),
          gate(flow.graph_, flow::unlimited,
               [s](const LayerMessage& message, Gate::output_ports_type& ports) noexcept {
                 if (message.step == s) (message.to_credits ? std::get<1>(ports) : std::get<0>(ports)).try_put(message);
               }),
          queue(flow.graph_),
          step(flow.graph_, threads(), [&flow](const LayerMessage& message) { return flow.take_step(message); }) {}
  };

  void make_edges() {
    if (steps_.decide) {
      flow::make_edge(heights_, decided_);
      flow::make_edge(flow::output_port<0>(decided_), backlog_);
      flow::make_edge(flow::output_port<1>(decided_), order_);
      flow::make_edge(backlog_, slots_);
    } else {
      flow::make_edge(heights_, slots_);
    }
    flow::make_edge(slots_, credits_node_);
    for (std::size_t s = 0; s < nodes_.size(); ++s) {
      StepNodes& nodes = *nodes_[s];
      flow::make_edge(flow::output_port<0>(credits_node_), nodes.gate);
      flow::make_edge(flow::output_port<0>(nodes.gate), nodes.queue);
      flow::make_edge(flow::output_port<1>(nodes.gate), credits_node_);
      flow::make_edge(nodes.queue, nodes.step);
      if (s > 0) flow::make_edge(nodes_[s - 1]->step, nodes.gate);
    }
    flow::make_edge(nodes_.back()->step, credits_node_);
    flow::make_edge(flow::output_port<1>(credits_node_), order_);
    flow::make_edge(order_, record_);
    flow::make_edge(record_, credits_node_);
    flow::make_edge(flow::output_port<2>(credits_node_), slots_.decrementer());
  }

  // --- the bodies of the nodes

  LayerMessage next_layer(tbb::flow_control& control) {
    if (!ended_) {
      const bool more = sent_ < count_ && !stop_.stopped();
      if (more && (!steps_.decide || heights_clock_.time([&] { return steps_.decide(sent_); }))) return {nullptr, sent_++};
      ended_ = true;
      all_sent_ = sent_ == count_ || !stop_.stopped();
      if (steps_.decide) return {nullptr, kAllDecided};
    }
    control.stop();
    return {};
  }

  void lend(const LayerMessage& message, CreditsNode::output_ports_type& ports) {
    if (message.position == kAllDecided) return;
    const bool ends = message.layer != nullptr && message.layer->phase == Phase::kRecorded;
    const auto leaving = credits_clock_.time(
        [&] { return message.layer == nullptr ? credits_.begin(message.position) : credits_.receive(*message.layer); });
    if (ends) std::get<2>(ports).try_put({});
    for (LayerState* const layer : leaving) {
      const LayerMessage next{layer, layer->ticket.position, layer->step};
      (layer->phase == Phase::kDone ? std::get<1>(ports) : std::get<0>(ports)).try_put(next);
    }
  }

  LayerMessage take_step(const LayerMessage& message) {
    LayerState& layer = *message.layer;
    if (stop_.gives_up()) {
      layer.status = interrupted();
    } else {
      layer.status = timed(nodes_[layer.step]->clock, [&] { return steps_.steps[layer.step].run(layer.ticket); });
      ++layer.step;
      if (layer.status && layer.step < nodes_.size()) request_needs(layer);
      layer.held = std::max(layer.held, steps_.bytes_held(layer.ticket.work));
    }
    if (!layer.status || layer.step == nodes_.size()) layer.phase = Phase::kDone;
    const bool to_credits = layer.phase == Phase::kDone || layer.needs_more || layer.held > layer.loan->bytes;
    return {&layer, message.position, message.step + 1, to_credits};
  }

  /// What the next step needs.
  void request_needs(LayerState& layer) {
    const Step& step = steps_.steps[layer.step];
    layer.needs_more = static_cast<bool>(step.needs);
    if (!layer.needs_more) return;
    layer.status = timed(nodes_[layer.step]->clock, [&]() -> Status {
      const Result<std::uint64_t> more = step.needs(layer.ticket);
      if (!more) return more.error();
      layer.more = *more;
      return {};
    });
  }

  LayerMessage record(const LayerMessage& message) {
    if (message.position == kAllDecided) {
      result_ = all_sent_ ? timed(record_clock_, steps_.decided) : interrupted();
    } else if (result_) {  // otherwise an earlier layer failed, and this one is not recorded
      result_ = message.layer->status;
      if (result_) result_ = timed(record_clock_, [&] { return steps_.record(message.layer->ticket); });
    }
    if (!result_) stop_.fail();
    if (message.layer == nullptr) return message;
    if (steps_.extra_bytes) message.layer->extra = steps_.extra_bytes();
    message.layer->phase = Phase::kRecorded;
    return message;
  }

  const std::uint32_t count_;
  const LayerSteps& steps_;
  StopSignal stop_;
  const std::function<bool()> is_stopped_ = [this] { return stop_.stopped(); };
  std::uint32_t sent_ = 0;                 // layers decided
  bool ended_ = false, all_sent_ = false;  // no further layers; for they are all decided
  Credits credits_;                        // of its node
  Status result_;                          // of `record`
  BusyClock heights_clock_, credits_clock_, record_clock_;

  flow::graph graph_;
  flow::input_node<LayerMessage> heights_;
  Gate decided_;
  flow::queue_node<LayerMessage> backlog_;
  flow::limiter_node<LayerMessage> slots_;
  CreditsNode credits_node_;
  std::vector<std::unique_ptr<StepNodes>> nodes_;  // of each step
  flow::sequencer_node<LayerMessage> order_;
  flow::function_node<LayerMessage, LayerMessage> record_;
};

}  // namespace

Status flow_layers(std::uint32_t count, const LayerSteps& steps, const FlowLimits& limits, const std::atomic<bool>& cancel,
                   FlowReport& report) {
  LayerFlow layers(count, steps, limits, cancel);
  const Status status = layers.run();
  report = layers.report();
  return status;
}

std::uint32_t layers_in_flight() { return 2 * static_cast<std::uint32_t>(threads()); }

}  // namespace lamina::pipeline

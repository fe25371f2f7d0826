#include "pipeline/graph.h"

#include <tbb/flow_graph.h>

#include <algorithm>
#include <mutex>
#include <vector>

namespace lamina::pipeline {
namespace {

namespace flow = tbb::flow;

/// What travels from node to node; the layer's data waits in its work slot.
struct Ticket {
  std::uint32_t position = 0;  // in the list of layers
  LayerWork* work = nullptr;
  std::uint64_t credits = 0;
  std::shared_ptr<LayerOutcome> outcome;
};

/// Lends out work slots and bytes. Slots are handed out last in, first out, so that few slots grow large.
class Budget {
 public:
  explicit Budget(const GraphLimits& limits) : limits_(limits) {}

  /// A slot for a layer that may need `bytes`, or nullptr if it has to wait.
  LayerWork* take(std::uint64_t bytes) {
    if (in_flight_ > 0 && (in_flight_ >= limits_.most_in_flight || used_ + bytes > limits_.budget_bytes)) return nullptr;
    if (free_.empty()) {
      slots_.push_back(std::make_unique<LayerWork>());
      free_.push_back(slots_.back().get());
    }
    LayerWork* work = free_.back();
    free_.pop_back();
    ++in_flight_;
    used_ += bytes;
    report_.most_in_flight = std::max(report_.most_in_flight, in_flight_);
    report_.most_bytes = std::max(report_.most_bytes, used_);
    return work;
  }

  void give_back(LayerWork* work, std::uint64_t bytes) {
    free_.push_back(work);
    --in_flight_;
    used_ -= bytes;
  }

  const GraphReport& report() const { return report_; }

 private:
  const GraphLimits& limits_;
  std::vector<std::unique_ptr<LayerWork>> slots_;
  std::vector<LayerWork*> free_;
  std::uint32_t in_flight_ = 0;
  std::uint64_t used_ = 0;
  GraphReport report_;
};

}  // namespace

Status run_layers(std::span<const Layer> layers, const LayerStages& stages, const GraphLimits& limits,
                  const std::atomic<bool>& cancel, GraphReport& report) {
  flow::graph graph;
  Budget budget(limits);
  std::mutex admission;
  std::uint32_t next = 0;      // position of the next layer to admit
  std::uint32_t recorded = 0;  // layers that `record` has seen
  bool stopped = false;    // no further admissions
  Status result;           // written by `record` only

  const auto step = [](const std::function<Status(LayerWork&, LayerOutcome&)>& stage) {
    return [&stage](Ticket ticket) {
      if (ticket.outcome->status) ticket.outcome->status = stage(*ticket.work, *ticket.outcome);
      return ticket;
    };
  };
  flow::function_node<Ticket, Ticket> raster(graph, flow::unlimited, step(stages.raster));
  flow::function_node<Ticket, Ticket> encode(graph, flow::unlimited, step(stages.encode));

  const auto admit = [&] {
    for (;;) {
      Ticket ticket;
      {
        const std::lock_guard lock(admission);
        if (cancel.load(std::memory_order_relaxed)) stopped = true;
        if (stopped || next == layers.size() || next - recorded >= limits.most_unrecorded) return;
        ticket.credits = limits.bytes_of_layer(layers[next]);
        ticket.work = budget.take(ticket.credits);
        if (ticket.work == nullptr) return;
        ticket.position = next++;
      }
      ticket.outcome = std::make_shared<LayerOutcome>();
      ticket.outcome->record.layer = layers[ticket.position];
      raster.try_put(std::move(ticket));
    }
  };
  flow::function_node<Ticket, Ticket> store(graph, flow::unlimited, [&](Ticket ticket) {
    if (ticket.outcome->status) ticket.outcome->status = stages.store(*ticket.work, *ticket.outcome);
    {
      const std::lock_guard lock(admission);
      budget.give_back(ticket.work, ticket.credits);
    }
    ticket.work = nullptr;
    admit();
    return ticket;
  });
  flow::sequencer_node<Ticket> in_order(graph, [](const Ticket& ticket) -> std::size_t { return ticket.position; });
  flow::function_node<Ticket, flow::continue_msg> record(graph, flow::serial, [&](const Ticket& ticket) {
    if (result) {  // else a lower layer failed, and this one is not recorded
      result = ticket.outcome->status ? stages.record(*ticket.outcome) : ticket.outcome->status;
    }
    {
      const std::lock_guard lock(admission);
      ++recorded;
      stopped |= !result;
    }
    admit();
    return flow::continue_msg();
  });

  flow::make_edge(raster, encode);
  flow::make_edge(encode, store);
  flow::make_edge(store, in_order);
  flow::make_edge(in_order, record);

  admit();
  graph.wait_for_all();
  report = budget.report();
  if (result && next < layers.size()) {
    return Error{Fault::kInterrupted, "interrupted; finished layers are kept, run again with --resume to go on"};
  }
  return result;
}

}  // namespace lamina::pipeline

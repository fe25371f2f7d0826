#include "pipeline/flow/graph.h"

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

/// Lends out work slots and bytes. Slots are handed out last in, first out, so that few slots grow large. What an idle
/// slot holds on to counts as used; it is let go where a layer would have to wait for it.
class Budget {
 public:
  explicit Budget(const GraphLimits& limits) : limits_(limits) {}

  struct Loan {
    LayerWork* work = nullptr;  // null: the layer has to wait
    std::uint64_t bytes = 0;
  };

  /// A slot for a layer that may need `bytes`.
  Loan take(std::uint64_t bytes) {
    if (in_flight_ > 0 && (in_flight_ >= limits_.most_in_flight || used_ + bytes > limits_.budget_bytes)) return {};
    if (idle_.empty()) {
      slots_.push_back(std::make_unique<LayerWork>());
      idle_.push_back({slots_.back().get(), 0});
    }
    for (Loan& slot : idle_) {  // the last one is going to be used: it is emptied last
      if (used_ + idle_bytes_ + bytes <= limits_.budget_bytes) break;
      if (slot.bytes == 0) continue;
      idle_bytes_ -= slot.bytes;
      *slot.work = LayerWork();
      slot.bytes = 0;
    }
    Loan loan = idle_.back();
    idle_.pop_back();
    idle_bytes_ -= loan.bytes;
    loan.bytes = std::max(loan.bytes, bytes);
    ++in_flight_;
    used_ += loan.bytes;
    report_.most_in_flight = std::max(report_.most_in_flight, in_flight_);
    report_.most_bytes = std::max(report_.most_bytes, used_ + idle_bytes_);
    return loan;
  }

  void give_back(const Loan& loan) {
    --in_flight_;
    used_ -= loan.bytes;
    idle_.push_back({loan.work, loan.work->bytes()});
    idle_bytes_ += idle_.back().bytes;
  }

  const GraphReport& report() const { return report_; }

 private:
  const GraphLimits& limits_;
  std::vector<std::unique_ptr<LayerWork>> slots_;
  std::vector<Loan> idle_;  // with what each holds on to
  std::uint32_t in_flight_ = 0;
  std::uint64_t used_ = 0;        // by layers in flight
  std::uint64_t idle_bytes_ = 0;  // of idle slots
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
  bool stopped = false;        // no further admissions
  Status result;               // written by `record` only

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
        const Budget::Loan loan = budget.take(limits.bytes_of_layer(layers[next]));
        if (loan.work == nullptr) return;
        ticket.work = loan.work;
        ticket.credits = loan.bytes;
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
      budget.give_back({ticket.work, ticket.credits});
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

// pipeline/layer_flow.h: layers through parallel steps into one ordered writer.
//
//      admit ──> prepare ──> in order ──> record
//        ^                                  │
//        └──────── credits in bytes ────────┘
//
// As pipeline/graph.h, for files that hold many layers: a layer keeps its room until it is recorded. Layers are admitted
// in order while the bytes that they may need fit the budget; one that alone exceeds it runs alone. `prepare` runs for
// many layers at once, `record` sees each once and in order, so it decides which failure is the first.
#pragma once

#include <tbb/flow_graph.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct FlowLimits {
  std::uint64_t budget_bytes = 1ull << 30;
  std::uint32_t most_in_flight = 1;
};

struct FlowReport {
  std::uint32_t most_in_flight = 0;
  std::uint64_t most_bytes = 0;  // of credits given out at once
};

/// Work  what a layer occupies while it is in flight; reused by later layers
/// count layers, numbered from 0; bytes_of(i) is what layer i may need at most
/// cancel looked at before each admission: layers in flight are finished and recorded, then the error is kInterrupted
/// errors the first failing layer's (in order), or kInterrupted
template <class Work>
Status flow_layers(std::uint32_t count, const std::function<std::uint64_t(std::uint32_t)>& bytes_of,
                   const std::function<Status(std::uint32_t, Work&)>& prepare,
                   const std::function<Status(std::uint32_t, Work&)>& record, const FlowLimits& limits,
                   const std::atomic<bool>& cancel, FlowReport& report) {
  namespace flow = tbb::flow;
  struct Ticket {
    std::uint32_t layer = 0;
    Work* work = nullptr;
    std::uint64_t credits = 0;
    std::shared_ptr<Status> status;
  };
  flow::graph graph;
  std::mutex admission;
  std::vector<std::unique_ptr<Work>> slots;
  std::vector<Work*> free;
  std::uint32_t next = 0, in_flight = 0;
  std::uint64_t used = 0;
  bool stopped = false;
  Status result;  // written by `record` only

  flow::function_node<Ticket, Ticket> prepare_node(graph, flow::unlimited, [&](Ticket ticket) {
    *ticket.status = prepare(ticket.layer, *ticket.work);
    return ticket;
  });
  const auto admit = [&] {
    for (;;) {
      Ticket ticket;
      {
        const std::lock_guard lock(admission);
        stopped |= cancel.load(std::memory_order_relaxed);
        if (stopped || next == count || in_flight >= limits.most_in_flight) return;
        ticket.credits = bytes_of(next);
        if (in_flight > 0 && used + ticket.credits > limits.budget_bytes) return;
        if (free.empty()) {
          slots.push_back(std::make_unique<Work>());
          free.push_back(slots.back().get());
        }
        ticket.work = free.back();
        free.pop_back();
        ticket.layer = next++;
        used += ticket.credits;
        ++in_flight;
        report.most_in_flight = std::max(report.most_in_flight, in_flight);
        report.most_bytes = std::max(report.most_bytes, used);
      }
      ticket.status = std::make_shared<Status>();
      prepare_node.try_put(std::move(ticket));
    }
  };
  flow::sequencer_node<Ticket> in_order(graph, [](const Ticket& ticket) -> std::size_t { return ticket.layer; });
  flow::function_node<Ticket, flow::continue_msg> record_node(graph, flow::serial, [&](const Ticket& ticket) {
    if (result) result = *ticket.status ? record(ticket.layer, *ticket.work) : *ticket.status;
    {
      const std::lock_guard lock(admission);
      free.push_back(ticket.work);
      used -= ticket.credits;
      --in_flight;
      stopped |= !result;
    }
    admit();
    return flow::continue_msg();
  });
  flow::make_edge(prepare_node, in_order);
  flow::make_edge(in_order, record_node);
  admit();
  graph.wait_for_all();
  if (result && next < count) return Error{Fault::kInterrupted, "interrupted; run it again"};
  return result;
}

}  // namespace lamina::pipeline

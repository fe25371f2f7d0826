// pipeline/flow/layer_flow.h: layers through parallel steps into one ordered writer.
//
//      admit ──> prepare ──> expand ──> in order ──> record
//        ^                     ^                       │
//        └─── credits in bytes ┴───────────────────────┘
//
// As pipeline/flow/graph.h, for files that hold many layers: a layer keeps its room until it is recorded. Layers are admitted
// in order while the bytes that they may need fit the budget. What a layer grows to may be known only when it is
// prepared: it says so, and is expanded, in order too, when that fits as well. A layer goes on whatever it needs once
// all before it are recorded. So credits stay within the budget and what one layer exceeds it by.
// `prepare` and `expand` run for many layers at once, `record` sees each once and in order, so it decides which failure
// is the first.
#pragma once

#include <tbb/flow_graph.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
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

/// What is done to a layer; layers are numbered from 0.
template <class Work>
struct LayerSteps {
  std::function<std::uint64_t(std::uint32_t)> bytes_of;                // that `prepare` may need at most
  std::function<Result<std::uint64_t>(std::uint32_t, Work&)> prepare;  // -> bytes that `expand` may need beside those
  std::function<Result<std::uint64_t>(std::uint32_t, Work&)> expand;   // -> bytes that the layer now holds in all
  std::function<Status(std::uint32_t, Work&)> record;
};

/// Work  what a layer occupies while it is in flight; reused by later layers
/// cancel looked at before each admission: layers in flight are finished and recorded, then the error is kInterrupted
/// errors the first failing layer's (in order), or kInterrupted
template <class Work>
Status flow_layers(std::uint32_t count, const LayerSteps<Work>& steps, const FlowLimits& limits,
                   const std::atomic<bool>& cancel, FlowReport& report) {
  namespace flow = tbb::flow;
  struct Ticket {
    std::uint32_t layer = 0;
    Work* work = nullptr;
    std::uint64_t credits = 0, more = 0;
    std::shared_ptr<Status> status;
  };
  flow::graph graph;
  std::mutex admission;
  std::vector<std::unique_ptr<Work>> slots;
  std::vector<Work*> free;
  std::map<std::uint32_t, Ticket> prepared;  // that wait to be expanded
  std::uint32_t next = 0, next_to_expand = 0, recorded = 0, in_flight = 0;
  std::uint64_t used = 0;
  bool stopped = false;
  Status result;  // written by `record` only

  flow::function_node<Ticket, Ticket> expand_node(graph, flow::unlimited, [&](Ticket ticket) {
    if (!*ticket.status) return ticket;
    const Result<std::uint64_t> held = steps.expand(ticket.layer, *ticket.work);
    if (!held) *ticket.status = held.error();
    const std::lock_guard lock(admission);
    const std::uint64_t now = held ? *held : ticket.credits;
    used += now - ticket.credits;
    ticket.credits = now;
    report.most_bytes = std::max(report.most_bytes, used);
    return ticket;
  });
  const auto expand_what_fits = [&] {
    for (;;) {
      Ticket ticket;
      {
        const std::lock_guard lock(admission);
        const auto found = prepared.find(next_to_expand);
        if (found == prepared.end()) return;
        if (next_to_expand != recorded && used + found->second.more > limits.budget_bytes) return;
        ticket = std::move(found->second);
        prepared.erase(found);
        ++next_to_expand;
        used += ticket.more;
        ticket.credits += ticket.more;
        report.most_bytes = std::max(report.most_bytes, used);
      }
      expand_node.try_put(std::move(ticket));
    }
  };
  flow::function_node<Ticket, flow::continue_msg> prepare_node(graph, flow::unlimited, [&](Ticket ticket) {
    const Result<std::uint64_t> more = steps.prepare(ticket.layer, *ticket.work);
    if (more) ticket.more = *more;
    if (!more) *ticket.status = more.error();
    {
      const std::lock_guard lock(admission);
      prepared.emplace(ticket.layer, std::move(ticket));
    }
    expand_what_fits();
    return flow::continue_msg();
  });
  const auto admit = [&] {
    for (;;) {
      Ticket ticket;
      {
        const std::lock_guard lock(admission);
        stopped |= cancel.load(std::memory_order_relaxed);
        if (stopped || next == count || in_flight >= limits.most_in_flight) return;
        ticket.credits = steps.bytes_of(next);
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
    if (result) result = *ticket.status ? steps.record(ticket.layer, *ticket.work) : *ticket.status;
    // Buffers are kept for the next layers, but idle ones hold no more than an eighth of the budget in all.
    if (ticket.credits > limits.budget_bytes / (8 * std::uint64_t{limits.most_in_flight})) *ticket.work = Work();
    {
      const std::lock_guard lock(admission);
      free.push_back(ticket.work);
      used -= ticket.credits;
      --in_flight;
      ++recorded;
      stopped |= !result;
    }
    expand_what_fits();
    admit();
    return flow::continue_msg();
  });
  flow::make_edge(expand_node, in_order);
  flow::make_edge(in_order, record_node);
  admit();
  graph.wait_for_all();
  if (result && next < count) return Error{Fault::kInterrupted, "interrupted; run it again"};
  return result;
}

}  // namespace lamina::pipeline

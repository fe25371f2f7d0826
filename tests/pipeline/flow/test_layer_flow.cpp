// tests/pipeline/flow/test_layer_flow.cpp: layers through prepare, expand and record within a budget of bytes.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <random>

#include "pipeline/flow/layer_flow.h"

namespace lamina::test {
namespace {

using pipeline::flow_layers;
using pipeline::FlowLimits;
using pipeline::FlowReport;
using pipeline::LayerSteps;

struct Fake {
  std::uint64_t holds = 0;
};

/// What layers hold at once, as they do it.
struct Meter {
  std::atomic<std::int64_t> now{0}, most{0};
  void add(std::int64_t bytes) {
    const std::int64_t sum = now += bytes;
    std::int64_t before = most;
    while (before < sum && !most.compare_exchange_weak(before, sum)) {
    }
  }
};

TEST(LayerFlow, LayersInFlightHoldTheBudgetOrItAndOneLayer) {
  std::mt19937 random(7);
  for (int turn = 0; turn < 40; ++turn) {
    constexpr std::uint32_t kLayers = 200;
    std::vector<std::uint64_t> first(kLayers), more(kLayers), real(kLayers);
    std::uint64_t largest = 0;
    for (std::uint32_t i = 0; i < kLayers; ++i) {
      first[i] = random() % 50;
      more[i] = random() % (turn % 4 == 0 ? 3000 : 300);
      real[i] = more[i] == 0 ? 0 : random() % more[i];  // what it comes to is no more than what was said
      largest = std::max(largest, more[i]);
    }
    FlowLimits limits;
    limits.budget_bytes = 1000;
    limits.most_in_flight = 16;
    Meter meter;
    std::vector<std::uint32_t> order;
    LayerSteps<Fake> steps;
    steps.bytes_of = [&](std::uint32_t i) { return first[i]; };
    steps.prepare = [&](std::uint32_t i, Fake& work) -> Result<std::uint64_t> {
      meter.add(static_cast<std::int64_t>(first[i]));
      work.holds = first[i];
      return more[i];
    };
    steps.expand = [&](std::uint32_t i, Fake& work) -> Result<std::uint64_t> {
      meter.add(static_cast<std::int64_t>(real[i]));
      work.holds += real[i];
      return work.holds;
    };
    steps.record = [&](std::uint32_t i, Fake& work) -> Status {
      order.push_back(i);
      meter.add(-static_cast<std::int64_t>(work.holds));
      return {};
    };
    FlowReport report;
    const std::atomic<bool> cancel{false};
    ASSERT_TRUE(flow_layers(kLayers, steps, limits, cancel, report).ok());
    ASSERT_EQ(order.size(), kLayers);
    EXPECT_TRUE(std::ranges::is_sorted(order));
    EXPECT_LE(meter.most, static_cast<std::int64_t>(limits.budget_bytes + largest));
    EXPECT_LE(report.most_bytes, limits.budget_bytes + largest);
    EXPECT_GE(report.most_bytes, static_cast<std::uint64_t>(meter.most));
    EXPECT_GE(report.most_in_flight, turn % 4 != 0 ? 2u : 1u);
  }
}

TEST(LayerFlow, TheFirstFailureInOrderIsTheAnswerWhereverItHappens) {
  for (const bool in_prepare : {true, false}) {
    LayerSteps<Fake> steps;
    std::uint32_t recorded = 0;
    const auto fails = [](std::uint32_t i) -> Result<std::uint64_t> {
      if (i == 17 || i == 23) return Error{Fault::kUsage, "layer " + std::to_string(i)};
      return std::uint64_t{1};
    };
    steps.bytes_of = [](std::uint32_t) { return 1; };
    steps.prepare = [&](std::uint32_t i, Fake&) { return in_prepare ? fails(i) : Result<std::uint64_t>(std::uint64_t{1}); };
    steps.expand = [&](std::uint32_t i, Fake&) { return in_prepare ? Result<std::uint64_t>(std::uint64_t{1}) : fails(i); };
    steps.record = [&](std::uint32_t, Fake&) -> Status { return ++recorded, Status(); };
    FlowReport report;
    FlowLimits limits;
    limits.most_in_flight = 8;
    const std::atomic<bool> cancel{false};
    const Status status = flow_layers(100, steps, limits, cancel, report);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().message, "layer 17");
    EXPECT_EQ(recorded, 17u);
  }
}

}  // namespace
}  // namespace lamina::test

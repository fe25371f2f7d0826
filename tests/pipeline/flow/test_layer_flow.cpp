// Layers through steps and a record within a budget of bytes.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <new>
#include <random>
#include <thread>

#include "pipeline/flow/layers.h"

namespace lamina::test {
namespace {

using pipeline::flow_layers;
using pipeline::FlowLimits;
using pipeline::FlowReport;
using pipeline::LayerSteps;
using pipeline::Ticket;

/// What layers hold at once, as they do it.
struct Meter {
  std::atomic<std::int64_t> now{0}, maximum{0};
  void add(std::int64_t bytes) {
    const std::int64_t sum = now += bytes;
    std::int64_t before = maximum;
    while (before < sum && !maximum.compare_exchange_weak(before, sum)) {
    }
  }
};

/// Scratch of layers that hold bytes and remember whose they are.
struct Slots {
  std::vector<std::uint64_t> holds;
  std::vector<std::atomic<int>> users;
  explicit Slots(std::uint32_t slots) : holds(slots, 0), users(slots) {}
};

/// Layers that hold `first` bytes, learn that they need `more`, and come to `real` of these.
struct Layers {
  std::vector<std::uint64_t> first, more, real;
};

Layers random_layers(std::uint32_t count, std::uint64_t maximum, std::mt19937& random) {
  Layers layers;
  for (std::uint32_t i = 0; i < count; ++i) {
    layers.first.push_back(random() % 50);
    layers.more.push_back(random() % maximum);
    layers.real.push_back(layers.more.back() == 0 ? 0 : random() % layers.more.back());
  }
  return layers;
}

TEST(LayerFlow, LayersInFlightHoldTheBudgetOrItAndOneLayer) {
  std::mt19937 random(7);
  for (int turn = 0; turn < 40; ++turn) {
    constexpr std::uint32_t kLayers = 200;
    const Layers layers = random_layers(kLayers, turn % 4 == 0 ? 3000 : 300, random);
    const bool from_work = turn % 2 == 0;
    FlowLimits limits;
    limits.budget_bytes = 1000;
    limits.max_in_flight = 16;
    Slots slots(limits.max_in_flight);
    Meter meter;
    std::vector<std::uint32_t> order;
    LayerSteps steps;
    const auto leave = [&](const Ticket& ticket) {
      meter.add(-static_cast<std::int64_t>(slots.holds[ticket.work]));
      slots.holds[ticket.work] = 0;
      --slots.users[ticket.work];
    };
    steps.bytes_of = [&](std::uint32_t i) { return layers.first[i]; };
    steps.steps = {{"first",
                    [&](const Ticket& ticket) -> Status {
                      EXPECT_EQ(++slots.users[ticket.work], 1) << "a slot is one layer's";
                      slots.holds[ticket.work] = layers.first[ticket.position];
                      meter.add(static_cast<std::int64_t>(layers.first[ticket.position]));
                      return {};
                    }},
                   {"second",
                    [&](const Ticket& ticket) -> Status {
                      slots.holds[ticket.work] += layers.real[ticket.position];
                      meter.add(static_cast<std::int64_t>(layers.real[ticket.position]));
                      if (!from_work) leave(ticket);
                      return {};
                    },
                    [&](const Ticket& ticket) -> Result<std::uint64_t> { return layers.more[ticket.position]; }}};
    steps.record = [&](const Ticket& ticket) -> Status {
      order.push_back(ticket.position);
      if (from_work) leave(ticket);
      return {};
    };
    steps.bytes_held = [&](std::uint32_t work) { return slots.holds[work]; };
    steps.let_go = [&](std::uint32_t work) { slots.holds[work] = 0; };
    steps.records_from_work = from_work;
    FlowReport report;
    const std::atomic<bool> cancel{false};
    ASSERT_TRUE(flow_layers(kLayers, steps, limits, cancel, report).ok());
    ASSERT_EQ(order.size(), kLayers);
    EXPECT_TRUE(std::ranges::is_sorted(order));
    const std::uint64_t largest = *std::ranges::max_element(layers.more);
    EXPECT_LE(meter.maximum, static_cast<std::int64_t>(limits.budget_bytes + largest));
    EXPECT_LE(report.max_bytes, limits.budget_bytes + largest);
    EXPECT_GE(report.max_bytes, static_cast<std::uint64_t>(meter.maximum));
    EXPECT_GE(report.max_in_flight, turn % 4 != 0 ? 2u : 1u);
    ASSERT_EQ(report.nodes.size(), 4u);
    EXPECT_EQ(report.nodes[3].name, "record");
  }
}

/// Steps that hold nothing.
LayerSteps plain_steps() {
  LayerSteps steps;
  steps.bytes_of = [](std::uint32_t) { return 1; };
  steps.record = [](const Ticket&) { return Status(); };
  steps.bytes_held = [](std::uint32_t) { return 0; };
  steps.let_go = [](std::uint32_t) {};
  return steps;
}

TEST(LayerFlow, TheFirstFailureInOrderIsTheAnswerWhereverItHappens) {
  const auto fails = [](const Ticket& ticket) -> Status {
    if (ticket.position == 17 || ticket.position == 23) return Error{Fault::kUsage, "layer " + std::to_string(ticket.position)};
    return {};
  };
  const auto works = [](const Ticket&) { return Status(); };
  for (int where = 0; where < 3; ++where) {
    LayerSteps steps = plain_steps();
    std::uint32_t recorded = 0;
    steps.steps = {{"first", where == 0 ? std::function<Status(const Ticket&)>(fails) : works},
                   {"second", where == 1 ? std::function<Status(const Ticket&)>(fails) : works,
                    [&](const Ticket& ticket) -> Result<std::uint64_t> {
                      const Status status = where == 2 ? fails(ticket) : Status();
                      if (!status) return status.error();
                      return std::uint64_t{1};
                    }}};
    steps.record = [&](const Ticket&) -> Status { return ++recorded, Status(); };
    FlowReport report;
    FlowLimits limits;
    limits.max_in_flight = 8;
    const std::atomic<bool> cancel{false};
    const Status status = flow_layers(100, steps, limits, cancel, report);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().message, "layer 17");
    EXPECT_EQ(recorded, 17u);
  }
}

TEST(LayerFlow, ACancelledFlowRecordsWhatIsInFlight) {
  LayerSteps steps = plain_steps();
  std::atomic<bool> cancel{false};
  std::atomic<std::uint32_t> made{0};
  std::uint32_t recorded = 0;
  steps.steps = {{"only", [&](const Ticket& ticket) -> Status {
                    ++made;
                    if (ticket.position == 20) cancel = true;
                    return {};
                  }}};
  steps.record = [&](const Ticket&) -> Status { return ++recorded, Status(); };
  FlowReport report;
  FlowLimits limits;
  limits.max_in_flight = 4;
  const Status status = flow_layers(1000, steps, limits, cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kInterrupted);
  EXPECT_EQ(recorded, made);
  EXPECT_LT(recorded, 1000u);
}

TEST(LayerFlow, LaterLayersRunAheadOfASlowOneByTheRecordSlotsNoMoreThan) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  for (const std::uint32_t slow : {0u, 1u, 50u}) {
    FlowLimits limits;
    limits.max_in_flight = 8;
    limits.record_slots = 12;
    LayerSteps steps = plain_steps();
    std::atomic<std::uint32_t> stored{0}, recorded{0}, furthest{0};
    const auto first = [&](const Ticket& ticket) -> Status {
      // A slow layer waits until the others are as far ahead as they may be, or for a while where they may not.
      for (int i = 0; ticket.position == slow && i < 200 && stored < slow + limits.record_slots - 1; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
      return {};
    };
    const auto store = [&](const Ticket&) -> Status {
      const std::uint32_t ahead = ++stored - recorded;
      std::uint32_t before = furthest;
      while (before < ahead && !furthest.compare_exchange_weak(before, ahead)) {
      }
      return {};
    };
    steps.steps = {{"first", first}, {"store", store}};
    steps.record = [&](const Ticket&) -> Status { return ++recorded, Status(); };
    FlowReport report;
    const std::atomic<bool> cancel{false};
    ASSERT_TRUE(flow_layers(200, steps, limits, cancel, report).ok());
    EXPECT_EQ(recorded, 200u);
    EXPECT_LE(furthest, limits.record_slots);
    EXPECT_GE(furthest, 4u) << "others continued meanwhile";
  }
}

TEST(LayerFlow, TheOldestLayerIsTakenFirst) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  FlowLimits limits;
  limits.max_in_flight = 8;
  limits.record_slots = 16;
  LayerSteps steps = plain_steps();
  std::vector<std::uint32_t> taken;
  const auto note = [&](const Ticket& ticket) -> Status { return taken.push_back(ticket.position), Status(); };
  steps.steps = {{"first", note}, {"second", note}, {"third", note}};
  FlowReport report;
  const std::atomic<bool> cancel{false};
  ASSERT_TRUE(flow_layers(100, steps, limits, cancel, report).ok());
  EXPECT_EQ(taken.size(), 300u);
  EXPECT_TRUE(std::ranges::is_sorted(taken)) << "one thread finishes a layer before it takes the next";
}

TEST(LayerFlow, EstimatesFollowWhatLayersHeld) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  constexpr std::uint64_t kMegabyte = 1 << 20;
  for (const std::uint64_t held : {8 * kMegabyte, 70 * kMegabyte}) {
    FlowLimits limits;
    limits.budget_bytes = 100 * kMegabyte;
    limits.max_in_flight = 8;
    Slots slots(limits.max_in_flight);
    Meter meter;
    LayerSteps steps = plain_steps();
    steps.bytes_of = [](std::uint32_t) { return 80 * kMegabyte; };
    steps.steps = {{"only", [&](const Ticket& ticket) -> Status {
                      slots.holds[ticket.work] = held;
                      meter.add(static_cast<std::int64_t>(held));
                      std::this_thread::sleep_for(std::chrono::milliseconds(1));
                      meter.add(-static_cast<std::int64_t>(held));
                      return {};
                    }}};
    steps.bytes_held = [&](std::uint32_t work) { return slots.holds[work]; };
    steps.let_go = [&](std::uint32_t work) { slots.holds[work] = 0; };
    FlowReport report;
    const std::atomic<bool> cancel{false};
    ASSERT_TRUE(flow_layers(60, steps, limits, cancel, report).ok());
    EXPECT_LE(meter.maximum, static_cast<std::int64_t>(limits.budget_bytes));
    EXPECT_GE(report.max_in_flight, held == 8 * kMegabyte ? 4u : 1u) << "80 MB were charged for 8";
    EXPECT_EQ(report.oversized, 0u);
  }
}

TEST(LayerFlow, AStepWithoutMemoryFailsItsLayerAndKeepsTheEarlierOnes) {
  LayerSteps steps = plain_steps();
  std::uint32_t recorded = 0;
  steps.steps = {{"only", [](const Ticket& ticket) -> Status {
                    if (ticket.position == 30) throw std::bad_alloc();
                    return {};
                  }}};
  steps.record = [&](const Ticket&) -> Status { return ++recorded, Status(); };
  FlowReport report;
  FlowLimits limits;
  limits.max_in_flight = 8;
  const std::atomic<bool> cancel{false};
  const Status status = flow_layers(100, steps, limits, cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kMemory);
  EXPECT_EQ(recorded, 30u);
}

TEST(LayerFlow, ALongLayerIsGivenUpBetweenItsStepsOnceCancelled) {
  LayerSteps steps = plain_steps();
  std::atomic<bool> cancel{false};
  std::atomic<std::uint32_t> made{0};
  const auto pause = [&](const Ticket&) -> Status {
    cancel = true;
    ++made;
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // at least, however busy the machine is
    return {};
  };
  for (int i = 0; i < 20; ++i) steps.steps.push_back({"pause", pause});
  FlowReport report;
  FlowLimits limits;
  limits.max_in_flight = 4;
  const Status status = flow_layers(2, steps, limits, cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kInterrupted);
  // Layers have 300 ms from the first reading of the flag, which follows a first step at the latest: two steps more.
  EXPECT_LE(made, 2u * 3u);
}

TEST(LayerFlow, SlotsServeOneLayerAtATimeHoweverShortItsStepsAre) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  constexpr std::uint32_t kLayers = 20'000;
  for (const bool from_work : {false, true}) {
    FlowLimits limits;
    limits.max_in_flight = 8;
    limits.record_slots = 12;
    std::vector<std::atomic<std::uint32_t>> work(limits.max_in_flight), results(limits.record_slots);
    std::vector<std::uint32_t> order;
    std::atomic<int> faults{0};
    LayerSteps steps = plain_steps();
    const auto begin = [&](const Ticket& ticket) -> Status {
      work[ticket.work] = results[ticket.record] = ticket.position;
      return {};
    };
    const auto check = [&](const Ticket& ticket) -> Status {
      faults += work[ticket.work] != ticket.position || results[ticket.record] != ticket.position;
      return {};
    };
    steps.steps = {{"begin", begin}, {"check", check}, {"again", check}};
    steps.record = [&](const Ticket& ticket) -> Status {
      faults += results[ticket.record] != ticket.position || (from_work && work[ticket.work] != ticket.position);
      order.push_back(ticket.position);
      return {};
    };
    steps.records_from_work = from_work;
    FlowReport report;
    const std::atomic<bool> cancel{false};
    ASSERT_TRUE(flow_layers(kLayers, steps, limits, cancel, report).ok());
    EXPECT_EQ(faults, 0);
    ASSERT_EQ(order.size(), kLayers);
    EXPECT_EQ(order.back(), kLayers - 1);
    EXPECT_TRUE(std::ranges::is_sorted(order));
  }
}

TEST(LayerFlow, ARecorderThatFailsEndsTheFlowWithItsError) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  LayerSteps steps = plain_steps();
  std::atomic<std::uint32_t> made{0};
  steps.steps = {{"only", [&](const Ticket&) -> Status { return ++made, Status(); }}};
  steps.record = [](const Ticket& ticket) -> Status {
    if (ticket.position == 40) return Error{Fault::kOutput, "full"};
    return {};
  };
  FlowLimits limits;
  limits.max_in_flight = 8;
  limits.record_slots = 16;
  FlowReport report;
  const std::atomic<bool> cancel{false};
  const Status status = flow_layers(10'000, steps, limits, cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().message, "full");
  EXPECT_LE(made, 40u + 2 * limits.record_slots) << "layers that cannot be recorded are not made";
}

TEST(LayerFlow, ACancelledFlowEndsWhileLayersWaitForBytes) {
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
  LayerSteps steps = plain_steps();
  std::atomic<bool> cancel{false};
  steps.bytes_of = [](std::uint32_t position) { return position % 3 == 0 ? 900 : 10; };
  const auto pause = [&](const Ticket& ticket) -> Status {
    if (ticket.position == 30) cancel = true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return {};
  };
  const auto needs = [](const Ticket&) -> Result<std::uint64_t> { return std::uint64_t{400}; };
  steps.steps = {{"first", pause}, {"second", pause, needs}, {"third", pause, needs}};
  FlowLimits limits;
  limits.budget_bytes = 1000;
  limits.max_in_flight = 8;
  FlowReport report;
  const auto start = std::chrono::steady_clock::now();
  const Status status = flow_layers(1'000'000, steps, limits, cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kInterrupted);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
}

/// Layers that are decided while they are made: `layers` of at most 1000.
struct Decided {
  std::uint32_t layers = 0;
  std::atomic<std::uint32_t> calls{0}, ended{0}, made{0}, recorded{0};
  LayerSteps steps = plain_steps();
  explicit Decided(std::uint32_t count) : layers(count) {
    steps.decide = [this](std::uint32_t position) {
      EXPECT_EQ(position, calls++) << "in order";
      return position < layers;
    };
    steps.decided = [this]() -> Status {
      EXPECT_EQ(recorded, 0u);
      return ++ended, Status();
    };
    steps.steps = {{"only", [this](const Ticket& ticket) -> Status {
                      EXPECT_LT(ticket.position, calls);
                      return ++made, Status();
                    }}};
    steps.record = [this](const Ticket& ticket) -> Status {
      EXPECT_EQ(ended, 1u) << "nothing is recorded before all are decided";
      EXPECT_EQ(ticket.position, recorded);
      return ++recorded, Status();
    };
  }
  Status flow(const std::atomic<bool>& cancel, FlowReport& report) const {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, 4);
    FlowLimits limits;
    limits.max_in_flight = 4;
    limits.record_slots = 8;
    return flow_layers(1000, steps, limits, cancel, report);
  }
};

TEST(LayerFlow, LayersAreMadeWhileOthersAreDecided) {
  for (const std::uint32_t layers : {0u, 1u, 5u, 300u, 1000u}) {
    Decided job(layers);
    // The last ones are not decided before a layer is made.
    const auto decide = job.steps.decide;
    job.steps.decide = [&](std::uint32_t position) {
      for (int i = 0; position == 5 && i < 2000 && job.made == 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      return decide(position);
    };
    FlowReport report;
    const std::atomic<bool> cancel{false};
    ASSERT_TRUE(job.flow(cancel, report).ok());
    EXPECT_EQ(job.recorded, layers);
    EXPECT_EQ(job.ended, 1u);
    EXPECT_EQ(report.nodes[0].name, "heights");
  }
}

TEST(LayerFlow, AFlowCancelledWhileLayersAreDecidedRecordsNone) {
  Decided job(1000);
  std::atomic<bool> cancel{false};
  const auto decide = job.steps.decide;
  job.steps.decide = [&](std::uint32_t position) {
    if (position == 20) cancel = true;
    return decide(position);
  };
  FlowReport report;
  const Status status = job.flow(cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kInterrupted);
  EXPECT_EQ(job.recorded, 0u);
  EXPECT_EQ(job.ended, 0u);
}

TEST(LayerFlow, AnErrorOnceAllAreDecidedIsTheFirst) {
  Decided job(100);
  job.steps.decided = []() -> Status { return Error{Fault::kOutput, "no manifest"}; };
  FlowReport report;
  const std::atomic<bool> cancel{false};
  const Status status = job.flow(cancel, report);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().message, "no manifest");
  EXPECT_EQ(job.recorded, 0u);
}

TEST(LayerFlow, AFlowWithoutLayersIsDone) {
  LayerSteps steps = plain_steps();
  steps.steps = {{"only", [](const Ticket&) -> Status { return Error{Fault::kUsage, "no layer"}; }}};
  FlowReport report;
  const std::atomic<bool> cancel{false};
  EXPECT_TRUE(flow_layers(0, steps, {}, cancel, report).ok());
  EXPECT_EQ(report.max_in_flight, 0u);
}

}  // namespace
}  // namespace lamina::test

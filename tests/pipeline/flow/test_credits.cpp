// The node that lends scratch and bytes to layers, message by message.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "pipeline/flow/credits.h"

namespace lamina::test {
namespace {

using pipeline::Credits;
using pipeline::FlowLimits;
using pipeline::LayerState;
using pipeline::LayerSteps;
using Phase = pipeline::LayerState::Phase;

/// Credits of layers of equal estimates, and the layers that left last.
struct Lender {
  std::uint64_t estimate = 400;
  std::map<std::uint32_t, std::uint64_t> held;  // by slot of scratch
  std::vector<std::uint32_t> emptied;           // slots, in the order of their emptying
  bool stop = false;
  const std::function<bool()> stopped = [this] { return stop; };
  LayerSteps steps;
  FlowLimits limits;
  std::unique_ptr<Credits> credits;
  std::map<std::uint32_t, LayerState*> out;  // by position: all that left and have not come back

  explicit Lender(std::uint64_t budget, std::uint32_t in_flight = 4, bool from_work = false) {
    limits.budget_bytes = budget;
    limits.max_in_flight = in_flight;
    limits.record_slots = 8;
    steps.bytes_of = [this](std::uint32_t) { return estimate; };
    steps.bytes_held = [this](std::uint32_t work) { return held[work]; };
    steps.let_go = [this](std::uint32_t work) { held[work] = 0, emptied.push_back(work); };
    steps.records_from_work = from_work;
    credits = std::make_unique<Credits>(steps, limits, stopped);
  }

  std::vector<std::uint32_t> leave(Credits::Leaving leaving) {
    std::vector<std::uint32_t> positions;
    for (LayerState* layer : leaving) {
      positions.push_back(layer->ticket.position);
      out[positions.back()] = layer;
    }
    return positions;
  }
  std::vector<std::uint32_t> begin(std::uint32_t position) { return leave(credits->begin(position)); }
  /// A layer comes back from a step, in which it held some bytes, and needs more.
  std::vector<std::uint32_t> needs(std::uint32_t position, std::uint64_t more, std::uint64_t bytes = 0) {
    LayerState& layer = *out[position];
    layer.held = std::max(layer.held, held[layer.ticket.work] = bytes);
    layer.needs_more = true;
    layer.more = more;
    return leave(credits->receive(layer));
  }
  std::vector<std::uint32_t> is(Phase phase, std::uint32_t position) {
    LayerState& layer = *out[position];
    layer.phase = phase;
    return leave(credits->receive(layer));
  }
};

using Positions = std::vector<std::uint32_t>;

TEST(Credits, LayersAreAdmittedInOrderWhileTheirEstimatesFit) {
  Lender lender(1000);
  EXPECT_EQ(lender.begin(0), Positions({0}));
  EXPECT_EQ(lender.begin(1), Positions({1}));
  EXPECT_EQ(lender.begin(2), Positions());
  lender.estimate = 1;
  EXPECT_EQ(lender.begin(3), Positions()) << "it would fit, but is not the next";
  EXPECT_EQ(lender.is(Phase::kDone, 1), Positions({1, 2, 3})) << "one is to be recorded, two are admitted";
  EXPECT_EQ(lender.out[1]->phase, Phase::kDone);
  EXPECT_EQ(lender.out[3]->phase, Phase::kStepping);
  EXPECT_LE(lender.credits->budget().max_bytes(), 1000u);
}

TEST(Credits, ALayerLargerThanTheBudgetRunsAlone) {
  Lender lender(100);
  EXPECT_EQ(lender.begin(0), Positions({0}));
  EXPECT_EQ(lender.begin(1), Positions());
  lender.out[0]->held = 300;
  EXPECT_EQ(lender.is(Phase::kDone, 0), Positions({0, 1}));
  EXPECT_EQ(lender.credits->oversized(), 1u);
}

TEST(Credits, ALayerThatNeedsMoreWaitsUnlessItIsTheNextToRecord) {
  Lender lender(1000);
  lender.begin(0), lender.begin(1);
  EXPECT_EQ(lender.needs(1, 300), Positions());
  EXPECT_EQ(lender.needs(0, 5000), Positions({0})) << "beyond the budget by one layer";
  EXPECT_EQ(lender.credits->budget().max_bytes(), 400u + 5400u);
  EXPECT_EQ(lender.is(Phase::kDone, 0), Positions({0, 1}));
  EXPECT_FALSE(lender.out[1]->needs_more);
}

TEST(Credits, NoLayerThatNeedsMoreOvertakesAnOlderOne) {
  Lender lender(1300);
  lender.begin(0), lender.begin(1), lender.begin(2);
  EXPECT_EQ(lender.needs(1, 500), Positions());
  EXPECT_EQ(lender.needs(2, 50), Positions()) << "it would fit";
  EXPECT_EQ(lender.is(Phase::kDone, 0), Positions({0, 1})) << "what layer 0 had goes to the older one";
  EXPECT_EQ(lender.is(Phase::kDone, 1), Positions({1, 2}));
}

TEST(Credits, WhatALayerHeldBeyondItsLoanCounts) {
  Lender lender(1000);
  lender.begin(0), lender.begin(1);
  LayerState& layer = *lender.out[1];
  layer.held = 700;
  EXPECT_EQ(lender.leave(lender.credits->receive(layer)), Positions()) << "it waits, as the budget is exceeded";
  EXPECT_EQ(lender.is(Phase::kDone, 0), Positions({0, 1}));
  EXPECT_EQ(lender.credits->budget().max_bytes(), 1100u);
}

TEST(Credits, SlotsAreLentLastInFirstOutAndEmptiedBeforeALayerWaits) {
  Lender lender(1100);
  lender.begin(0), lender.begin(1);
  const std::uint32_t first = lender.out[0]->ticket.work, second = lender.out[1]->ticket.work;
  lender.held[first] = 300, lender.held[second] = 350;
  lender.is(Phase::kDone, 0), lender.is(Phase::kDone, 1);
  lender.begin(2);
  EXPECT_EQ(lender.out[2]->ticket.work, second);
  EXPECT_TRUE(lender.emptied.empty()) << "300 idle bytes and 400 fit";
  lender.estimate = 500;
  EXPECT_EQ(lender.begin(3), Positions({3}));
  EXPECT_EQ(lender.emptied, Positions({first}));
}

TEST(Credits, ALayerKeepsItsScratchUntilRecordedIfTheRecorderReadsIt) {
  Lender lender(10'000, 1, true);
  lender.begin(0);
  EXPECT_EQ(lender.begin(1), Positions());
  EXPECT_EQ(lender.is(Phase::kDone, 0), Positions({0}));
  EXPECT_EQ(lender.is(Phase::kRecorded, 0), Positions({1}));
}

TEST(Credits, BytesOfTheRecorderAreThoseAfterItsLastLayer) {
  Lender lender(1000);
  for (std::uint32_t i = 0; i < 3; ++i) lender.begin(i), lender.is(Phase::kDone, i);
  lender.out[0]->extra = 100, lender.out[1]->extra = 200, lender.out[2]->extra = 700;
  for (const std::uint32_t late : {0u, 2u, 1u}) lender.is(Phase::kRecorded, late);
  lender.estimate = 301;
  lender.begin(3);
  EXPECT_EQ(lender.begin(4), Positions()) << "of 1000 bytes 700 are kept and 301 lent";
}

TEST(Credits, StoppedLayersPassWithoutALoan) {
  Lender lender(1000);
  lender.begin(0), lender.begin(1), lender.begin(2);
  lender.stop = true;
  EXPECT_EQ(lender.is(Phase::kDone, 0), Positions({0, 2}));
  EXPECT_EQ(lender.out[2]->phase, Phase::kDone);
  EXPECT_EQ(lender.out[2]->status.error().fault, Fault::kInterrupted);
  EXPECT_FALSE(lender.out[2]->loan);
  EXPECT_EQ(lender.is(Phase::kDone, 1), Positions({1}));
  for (const std::uint32_t i : {0u, 1u, 2u}) EXPECT_EQ(lender.is(Phase::kRecorded, i), Positions());
  EXPECT_EQ(lender.begin(3), Positions({3})) << "its slot is free again";
}

}  // namespace
}  // namespace lamina::test

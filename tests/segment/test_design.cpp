// tests/segment/test_design.cpp: fillings from targets: the model of slots, the limits, the search.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "stages/segment/design.h"
#include "tests/segment/slow_printer.h"

namespace lamina::segment {
namespace {

constexpr double kSquareMm = 1e-6;  // m2

DesignLimits limits() {
  const auto found = DesignLimits::of(test::slow_printer(), anet_a8_calibration());
  EXPECT_TRUE(found.ok());
  return *found;
}

Result<Segmentation> plan_of(const Choice& choice) {
  const DesignLimits bounds = limits();
  return bounds.plan_of(bounds.settings_of(choice));
}

PoreTarget porous(double porosity, double darcy) {
  PoreTarget target;
  if (porosity > 0) target.porosity = porosity;
  if (darcy > 0) target.permeability_m2 = darcy * 9.869233e-13;
  return target;
}

/// The pores of a found design, and that the machine can deposit it without a warning.
void expect_sound(const Design& design) {
  EXPECT_TRUE(check(design.plan, 0.4).ok());
  for (const Warning& warning : warnings(design.plan, anet_a8_calibration())) ADD_FAILURE() << warning.text;
  EXPECT_GE(design.plan.thick_extrusion, 75);
  EXPECT_LE(design.plan.thick_extrusion, 125);
  EXPECT_GE(design.pores.width_mm, 0.0299);
  EXPECT_GE(design.pores.length_mm, 0.299);
  EXPECT_LE(design.plan.thin_mm, 4.45 / 2 + 1e-3);
  // A thin segment begins and ends at the speed of the thick one; the machine comes near to its commands.
  const double slow = 15 * design.plan.thick_speed / 100, reported = 15 * design.plan.thin_speed / 100;
  EXPECT_GE(std::sqrt(slow * slow + 400 * design.plan.thin_mm), 0.76 * reported);
  EXPECT_LE(design.plan.continuous, DesignLimits::kMaxContinuous);
}

TEST(SlotModel, AStraightSlotIsTheCubicLaw) {
  // Layers that are thin for their beads: walls stand straight. Long stretches: their round ends do not matter.
  Segmentation plan;
  plan.thick_mm = plan.thin_mm = 1000;
  plan.thick_width_mm = 0.5;
  plan.thin_width_mm = 0.3;
  plan.continuous_width_mm = 0.4;
  plan.spacing_sc_mm = 0.45;
  const double width = 0.1, cell = 2 * 0.45 * 2000;
  const Slots slots = slots_of(plan, 1e-4);
  EXPECT_NEAR(slots.permeability_m2 / kSquareMm, 2 * 1000 * std::pow(width, 3) / 12 / cell, 0.005 * std::pow(width, 3));
  EXPECT_NEAR(slots.permeability_m2 / kSquareMm / (2 * 1000 * std::pow(width, 3) / 12 / cell), 1, 0.005);
  EXPECT_NEAR(slots.porosity, 2 * 1000 * width / cell, 1e-3);
  EXPECT_NEAR(slots.throat_mm, width, 1e-3);
}

TEST(SlotModel, ContinuousLinesApartAreSlotsToo) {
  Segmentation plan;
  plan.continuous = 3;
  plan.thick_mm = plan.thin_mm = 1000;
  plan.thick_width_mm = plan.thin_width_mm = plan.continuous_width_mm = 0.4;
  plan.spacing_sc_mm = 0.4;
  plan.spacing_cc_mm = 0.45;
  const double cell = 2 * 0.4 + 2 * 0.45;
  EXPECT_NEAR(slots_of(plan, 1e-4).permeability_m2 / kSquareMm / (2 * std::pow(0.05, 3) / 12 / cell), 1, 0.01);
}

TEST(SlotModel, CuspsAreVoidThatLeadsNowhere) {
  Segmentation plan;
  plan.thick_width_mm = plan.thin_width_mm = plan.continuous_width_mm = 0.4;
  plan.spacing_sc_mm = 0.4;
  const Slots slots = slots_of(plan, 0.3);
  const double corners = 0.3 * 0.3 * (1 - std::acos(-1) / 4);  // next to two half circles, of each bead
  EXPECT_NEAR(slots.porosity, corners / (0.4 * 0.3), 2e-3);
  EXPECT_LT(slots.permeability_m2, 1e-14);
}

TEST(SlotModel, WiderAndLongerPoresLetMoreThrough) {
  const auto through = [](double gap, double thin, double thick) {
    const auto plan = plan_of(limits().nearest({1, 100, thick, thin, gap}));
    EXPECT_TRUE(plan.ok());
    return slots_of(*plan, 0.3);
  };
  const Slots middle = through(0.005, 1.5, 1.5), wider = through(0.01, 1.5, 1.5), longer = through(0.005, 1.8, 1.5),
              rarer = through(0.005, 1.5, 2);
  EXPECT_GT(wider.permeability_m2, middle.permeability_m2);
  EXPECT_GT(wider.porosity, middle.porosity);
  EXPECT_GT(longer.permeability_m2, middle.permeability_m2);
  EXPECT_GT(longer.porosity, middle.porosity);
  EXPECT_LT(rarer.permeability_m2, middle.permeability_m2);
  EXPECT_LT(rarer.porosity, middle.porosity);
}

TEST(DesignLimits, WhatIsRequestedIsBroughtWithinThem) {
  for (const double extrusion : {20.0, 90.0, 300.0}) {
    for (const double far : {-50.0, 50.0}) {
      const Choice choice = limits().nearest({far > 0 ? 9u : 0u, extrusion, far, far, far});
      const auto plan = plan_of(choice);
      ASSERT_TRUE(plan.ok()) << plan.error().message;
      EXPECT_TRUE(warnings(*plan, anet_a8_calibration()).empty()) << extrusion << " " << far;
    }
  }
}

TEST(DesignReach, HasThePlansThatASearchFindsAndNoFarTarget) {
  const auto reach = reach_of(limits());
  for (const auto& lines : reach) {
    EXPECT_LT(lines.porosity.minimum, lines.porosity.maximum);
    EXPECT_LT(lines.permeability_m2.minimum, lines.permeability_m2.maximum);
    EXPECT_GT(lines.pore_width_mm.minimum, 0.0299);
  }
  EXPECT_GT(reach[0].permeability_m2.maximum, reach[2].permeability_m2.maximum) << "more pores a line";
  for (const double darcy : {0.01, 20.0, 100.0, 300.0, 1e5}) {
    const Design found = search(porous(0, darcy), limits(), {});
    EXPECT_LE(found.slots.permeability_m2, 1.02 * reach[0].permeability_m2.maximum) << darcy;
    EXPECT_GE(found.slots.permeability_m2, 0.98 * reach[2].permeability_m2.minimum) << darcy;
    EXPECT_EQ(out_of_reach(porous(0, darcy), reach), darcy < 1 || darcy > 1000) << darcy;
  }
  EXPECT_TRUE(out_of_reach(porous(0.5, 100), reach)) << "one of two is enough";
  EXPECT_FALSE(out_of_reach(porous(0.5, 1e5), {})) << "nothing is known";
}

TEST(DesignLimits, WithoutWidthsOfRepeatedIntervalsNothingIsDesigned) {
  Calibration calibration = anet_a8_calibration();
  calibration.repeated.clear();
  const auto none = DesignLimits::of(test::slow_printer(), calibration);
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.error().message.find("repeated"), std::string::npos);
  calibration = anet_a8_calibration();
  calibration.repeated[1].thin_speed_percent = 150;
  EXPECT_FALSE(DesignLimits::of(test::slow_printer(), calibration).ok());
  Extruder lazy = test::slow_printer();
  lazy.speed.acceleration_mm_s2 = 50;
  EXPECT_FALSE(DesignLimits::of(lazy, anet_a8_calibration()).ok()) << "no stretch comes near to its speed";
}

TEST(DesignLimits, WhatWasMeasuredIsNotBeyondIt) {
  for (const double extrusion : {75.0, 100.0, 125.0})
    for (const double part : limits().beyond({2, extrusion, 1.5, 2, 0.008})) EXPECT_EQ(part, 0);
  EXPECT_GT(limits().beyond({1, 110, 1.5, 1.5, 0})[0], 0);
  EXPECT_GT(limits().beyond({1, 100, 2, 1.5, 0})[1], 0);
  EXPECT_LT(limits().beyond({1, 100, 1.5, 1.2, 0})[2], 0);
}

TEST(DesignSearch, TargetsWithinTheTablesAreMet) {
  for (const auto& [porosity, darcy] : {std::pair{0.24, 100.0}, {0.20, 60.0}, {0.18, 0.0}, {0.0, 40.0}, {0.0, 250.0}}) {
    const Design design = search(porous(porosity, darcy), limits(), {});
    EXPECT_LE(design.miss, 5e-3) << porosity << " " << darcy;
    expect_sound(design);
  }
}

TEST(DesignSearch, OfManyTheOneThatWasMeasuredIsTaken) {
  const auto measured = plan_of({1, 100, 1.5, 1.5, 0.01});
  ASSERT_TRUE(measured.ok());
  const Slots slots = slots_of(limits().deposited(*measured), 0.3);
  PoreTarget target;
  target.permeability_m2 = slots.permeability_m2;
  const Design design = search(target, limits(), {});
  EXPECT_LE(design.miss, 5e-3);
  EXPECT_LT(design.beyond, 0.02) << design.choice.thick_mm << " " << design.choice.thin_mm << " " << design.choice.gap_mm;
}

TEST(DesignSearch, PoresHaveTheirWidthAndLength) {
  PoreTarget target;
  target.pore_width_mm = 0.12;
  target.pore_length_mm = 0.9;
  const Design design = search(target, limits(), {});
  EXPECT_NEAR(design.pores.width_mm, 0.12, 0.0006);
  EXPECT_NEAR(design.pores.length_mm, 0.9, 0.0045);
  expect_sound(design);
}

TEST(DesignSearch, WhatCannotBeReachedIsApproached) {
  const Design maximum = search(porous(0.6, 0), limits(), {});
  EXPECT_GT(maximum.miss, 0.2);
  expect_sound(maximum);
  // Nothing else within the limits comes nearer.
  for (const double thin : {1.2, 1.8, 2.2})
    for (const double gap : {-0.01, 0.0, 0.018})
      for (const double extrusion : {75.0, 110.0, 125.0})
        EXPECT_LE(slots_of(limits().deposited(*plan_of(limits().nearest({1, extrusion, 1, thin, gap}))), 0.3).porosity,
                  maximum.slots.porosity + 1e-4);
  const Design far = search(porous(0, 1e5), limits(), {});
  EXPECT_GT(far.miss, 0.5);
  expect_sound(far);
}

TEST(DesignSearch, TheRatioOfABetterComputationMovesThePlan) {
  const Design plain = search(porous(0.24, 100), limits(), {}), corrected = search(porous(0.24, 100), limits(), {0.99, 0.8});
  EXPECT_LE(corrected.miss, 5e-3);
  EXPECT_NEAR(corrected.slots.permeability_m2, 100 * 9.869233e-13, 1e-12);
  EXPECT_NEAR(slots_of(limits().deposited(corrected.plan), 0.3).permeability_m2, 125 * 9.869233e-13, 2e-12);
  EXPECT_NE(plain.settings.spacing_sc_mm, corrected.settings.spacing_sc_mm);
  const Design again = search(porous(0.24, 100), limits(), {0.99, 0.8});
  EXPECT_EQ(again.settings.spacing_sc_mm, corrected.settings.spacing_sc_mm);
  EXPECT_EQ(again.settings.thin_mm, corrected.settings.thin_mm);
}

TEST(DesignSearch, WhatIsKnownOfAPlanHoldsThereAndFadesAwayFromIt) {
  const DesignLimits bounds = limits();
  const PoreTarget target = porous(0.21, 0);
  const Design free = search(target, bounds, {});
  const std::vector<RatioAt> here{{free.choice, {1.08, 0.7}}};
  // Of that plan what is known, of others something between that and nothing.
  const Design again = search(porous(0.21 * 1.08, 0), bounds, {}, {}, here);
  EXPECT_LT(again.miss, 5e-3);
  EXPECT_GT(again.ratio.porosity, 1.0);
  EXPECT_LE(again.ratio.porosity, 1.08);
  const Design far = search(porous(0.165, 0), bounds, {}, {3, 3}, here);
  EXPECT_LT(far.ratio.porosity, again.ratio.porosity);
  EXPECT_GT(far.ratio.permeability, again.ratio.permeability);
  EXPECT_NEAR(search(target, bounds, {}, {}, std::vector<RatioAt>{{free.choice, {1, 1}}}).slots.porosity, free.slots.porosity,
              1e-6);
}

}  // namespace
}  // namespace lamina::segment

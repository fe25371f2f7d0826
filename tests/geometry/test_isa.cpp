#include "stages/geometry/isa.h"

#include <gtest/gtest.h>

namespace lamina::test {
namespace {

TEST(Isa, WhatTheProcessorHasIsUsedAndWhatItLacksIsRefusedInALine) {
  const Isa widest = widest_isa();
  ASSERT_NE(widest, Isa::kAuto);
  EXPECT_EQ(*usable_isa(Isa::kAuto), widest);
  for (Isa isa : {Isa::kPlain, Isa::kAvx2, Isa::kAvx512}) {
    const Result<Isa> usable = usable_isa(isa);
    EXPECT_EQ(usable.ok(), isa <= widest) << isa_name(isa);
    if (usable) {
      EXPECT_EQ(*usable, isa);
    } else {
      EXPECT_EQ(usable.error().fault, Fault::kUsage);
      const std::string& reported = usable.error().message;
      EXPECT_TRUE(reported.starts_with("run.isa: " + std::string(isa_name(isa)) + " is more than ")) << reported;
      EXPECT_TRUE(reported.ends_with("use auto, or " + std::string(isa_name(widest)) + " at most")) << reported;
    }
  }
}

TEST(Isa, WhatIsInTheWayIsNamed) {
  EXPECT_EQ(usable_isa(Isa::kAvx512, Isa::kAvx2, nullptr).error().message,
            "run.isa: avx512 is more than this processor has; use auto, or avx2 at most");
  EXPECT_EQ(usable_isa(Isa::kAvx512, Isa::kAvx2, "plain").error().message,
            "run.isa: avx512 is more than this processor has; use auto, or plain at most");
  EXPECT_EQ(usable_isa(Isa::kAvx512, Isa::kAvx512, "avx2").error().message,
            "run.isa: avx512 is more than the environment variable LAMINA_ISA=avx2 allows; unset it, or use auto, or "
            "avx2 at most");
  EXPECT_EQ(*usable_isa(Isa::kAuto, Isa::kAvx512, "plain"), Isa::kPlain);
  EXPECT_EQ(*usable_isa(Isa::kAvx2, Isa::kAvx512, "avx2"), Isa::kAvx2);
}

TEST(Isa, ACapTakesInstructionsAwayAndGivesNone) {
  constexpr struct {
    Isa has;
    const char* cap;
    Isa left;
  } kTable[] = {
      {Isa::kAvx512, nullptr, Isa::kAvx512}, {Isa::kAvx512, "avx2", Isa::kAvx2},   {Isa::kAvx512, "plain", Isa::kPlain},
      {Isa::kAvx2, "avx512", Isa::kAvx2},    {Isa::kAvx2, "plain", Isa::kPlain},   {Isa::kPlain, "avx2", Isa::kPlain},
      {Isa::kAvx512, "auto", Isa::kAvx512},  {Isa::kAvx512, "sse9", Isa::kAvx512}, {Isa::kAvx2, "", Isa::kAvx2},
  };
  for (const auto& row : kTable)
    EXPECT_EQ(*usable_isa(Isa::kAuto, row.has, row.cap), row.left) << isa_name(row.has) << ' ' << (row.cap ? row.cap : "-");
}

}  // namespace
}  // namespace lamina::test

// tests/support/test_late.cpp: libraries that are loaded when they are needed.
#include <gtest/gtest.h>

#include "stages/support/late/late.h"

namespace lamina {
namespace {

void* found = nullptr;
constexpr LateFunction kCosine{"cos", [](void* address) { found = address; }};
constexpr LateFunction kMissing{"lamina_never_heard_of", [](void*) {}};

TEST(Late, FunctionsOfALibraryAreFoundByName) {
  ASSERT_TRUE(load_library("libm.so.6", std::span(&kCosine, 1)).ok());
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(reinterpret_cast<double (*)(double)>(found)(0), 1);
}

TEST(Late, WhatIsMissingIsReportedInALine) {
  for (const Status& status :
       {load_library("liblamina_nowhere.so.1", {}), load_library("libm.so.6", std::span(&kMissing, 1))}) {
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().fault, Fault::kInternal);
    EXPECT_NE(status.error().message.find("install"), std::string::npos) << status.error().message;
    EXPECT_EQ(status.error().message.find('\n'), std::string::npos);
  }
  EXPECT_NE(load_library("liblamina_nowhere.so.1", {}).error().message.find("liblamina_nowhere.so.1"), std::string::npos);
}

}  // namespace
}  // namespace lamina

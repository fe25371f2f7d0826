#include "stages/support/memory_gate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace lamina {
namespace {

TEST(MemoryGate, PassesStayWithinTheBudgetOrAreAlone) {
  constexpr std::uint64_t kBudget = 100;
  MemoryGate gate(kBudget);
  std::atomic<std::uint64_t> used{0}, tasks{0}, wrong{0}, done{0};
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (unsigned i = 0; i < 500; ++i) {
        const std::uint64_t bytes = (t * 31 + i * 17) % 150;  // some above the budget
        const auto pass = gate.enter(bytes);
        const std::uint64_t now = used += bytes, others = tasks++;
        wrong += now > kBudget && others > 0 ? 1 : 0;
        std::this_thread::yield();
        --tasks;
        used -= bytes;
        ++done;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(done, 2000u);
  EXPECT_EQ(wrong, 0u);
}

}  // namespace
}  // namespace lamina

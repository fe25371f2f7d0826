// Instances at one position: what is left wind about every point as often, or by a divisor of it.
#include <gtest/gtest.h>

#include "pipeline/plan/repeated.h"

namespace lamina::pipeline {
namespace {

/// Instances of meshes of 10 x 10 x 10 nm at x, in order.
Scene scene_at(std::initializer_list<Nm> positions) {
  Scene scene;
  scene.meshes.resize(1);
  scene.meshes[0].bounds = {{0, 0, 0}, {10, 10, 10}};
  scene.parts.resize(1);
  for (const Nm x : positions) {
    scene.instances.push_back({0, {x, 0, 0}});
    scene.part_of_instance.push_back(0);
  }
  return scene;
}

std::vector<Nm> left(FillRule rule, std::initializer_list<Nm> positions) {
  Scene scene = scene_at(positions);
  drop_repeated(rule, scene);
  std::vector<Nm> at;
  for (const Instance& instance : scene.instances) at.push_back(instance.offset.x);
  EXPECT_EQ(scene.part_of_instance.size(), at.size());
  EXPECT_EQ(scene.parts[0].notes.size(), at.size() < positions.size() ? 1u : 0u);
  return at;
}

TEST(Repeated, EqualNumbersOfABodyBecomeOne) {
  EXPECT_EQ(left(FillRule::kNonzero, {0, 0, 0}), (std::vector<Nm>{0}));
  EXPECT_EQ(left(FillRule::kNonzero, {0, 5, 0, 5}), (std::vector<Nm>{0, 5}));
  EXPECT_EQ(left(FillRule::kNonzero, {0, 0, 5, 5, 5, 5}), (std::vector<Nm>{0, 5, 5}));
  EXPECT_EQ(left(FillRule::kPositive, {0, 0, 100, 100, 100}), (std::vector<Nm>{0, 100}));
}

TEST(Repeated, NumbersWithoutADivisorStay) {
  // A mesh may wind backwards: two against one of them is not one against one.
  EXPECT_EQ(left(FillRule::kNonzero, {0, 0, 5}), (std::vector<Nm>{0, 0, 5}));
}

TEST(Repeated, EvenOddKeepsTheParity) {
  EXPECT_EQ(left(FillRule::kEvenOdd, {0, 0, 0, 5}), (std::vector<Nm>{0, 5}));
  EXPECT_EQ(left(FillRule::kEvenOdd, {0, 0, 0, 0}), (std::vector<Nm>{0, 0}));
}

}  // namespace
}  // namespace lamina::pipeline

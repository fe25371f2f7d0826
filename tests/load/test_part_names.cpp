#include <gtest/gtest.h>

#include "stages/load/load.h"

namespace lamina::test {
namespace {

TEST(PartNames, EndingsInAnyCaseAndGzippedOnesNameParts) {
  for (const char* name : {"a.stl", "b/A.STL", "a.obj.gz", "a.3mf"}) EXPECT_TRUE(load::is_part_name(name)) << name;
  for (const char* name : {"a.toml", ".stl", "b/.stl.gz", "stl", "a.gz", ""}) EXPECT_FALSE(load::is_part_name(name)) << name;
  EXPECT_EQ(load::part_bytes("a.STL", 10), 40u);
  EXPECT_EQ(load::part_bytes("a.stl.gz", 10), 160u);
  EXPECT_EQ(load::part_bytes("a.3mf", 10), 400u);
  EXPECT_EQ(load::part_bytes("job.toml", 10), 10u);
}

}  // namespace
}  // namespace lamina::test

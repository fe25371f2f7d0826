#include "pipeline/batch/record.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

TEST(BatchRecord, ALineThatIsNestedDeeplyIsReadWithoutUsingUpTheStack) {
  const test::Directory directory;
  const std::string id(32, 'a'), deep(200'000, '['), end(200'000, ']');
  std::ofstream(directory / "batch.jsonl") << R"({"ended":")" << id << R"(","output":"","outcome":"done","hash":")" << id
                                           << R"(","seconds":1,"files":1,"bytes":1,"result":)" << deep << end << "}\n";
  EXPECT_TRUE(BatchRecord::open(directory.path().string(), true, false).ok());
}

}  // namespace
}  // namespace lamina::pipeline

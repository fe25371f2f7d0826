// Every input that ever broke a reader, and the seeds of every target, with any compiler and any sanitizer.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/fuzz/target.h"

namespace lamina::fuzz {
namespace {

namespace fs = std::filesystem;

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class Fuzz : public testing::TestWithParam<std::string> {
 protected:
  const Target& target() const {
    for (const Target& one : targets()) {
      if (one.name == GetParam()) return one;
    }
    throw std::logic_error("no such target");
  }
  bool accepts(std::string_view bytes) const {
    try {
      return run_target(target(), bytes);
    } catch (const BrokenLaw& broken) {
      ADD_FAILURE() << broken.what();
      return false;
    }
  }
};

TEST_P(Fuzz, AcceptsItsSeedsAndKeepsItsLawsForTheStoredCorpus) {
  const auto seeds = target().seeds();
  EXPECT_FALSE(seeds.empty());
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    EXPECT_TRUE(accepts(seeds[i])) << "seed " << i << ":\n" << seeds[i].substr(0, 2000);
    EXPECT_LE(seeds[i].size(), target().max_bytes) << "seed " << i;
  }
  const char* const own = std::getenv("LAMINA_FUZZ_INPUTS");  // a file or a folder instead, to reproduce a finding
  const fs::path inputs = own != nullptr ? fs::path(own) : fs::path(LAMINA_TEST_DIR) / "corpus/fuzz" / target().name;
  if (fs::is_regular_file(inputs)) accepts(bytes_of(inputs));
  if (!fs::is_directory(inputs)) return;
  for (const auto& entry : fs::recursive_directory_iterator(inputs)) {
    SCOPED_TRACE(entry.path().string());
    if (entry.is_regular_file()) accepts(bytes_of(entry.path()));
  }
}

// The law of work is one: a reader of a file that reads it again for each of its pages breaks it.
TEST(FuzzCorpus, ReadingAFileManyTimesBreaksTheLawOfWork) {
  Target greedy;
  greedy.run = [](std::string_view bytes) {
    MemoryFile file("pages.tif");
    const fs::path path = file.hold(bytes);
    std::size_t sum = 0;
    for (int page = 0; page < 20; ++page) sum += bytes_of(path).size();
    return sum > 0;
  };
  if (!fs::exists("/proc/self/io")) GTEST_SKIP() << "the system does not count bytes";
  EXPECT_TRUE(run_target(greedy, std::string(10'000, 'x')));
  EXPECT_THROW(run_target(greedy, std::string(1'000'000, 'x')), BrokenLaw);
}

TEST(FuzzCorpus, EveryFolderBelongsToATarget) {
  for (const auto& entry : fs::directory_iterator(fs::path(LAMINA_TEST_DIR) / "corpus/fuzz")) {
    bool known = !entry.is_directory();
    for (const Target& target : targets()) known |= entry.path().filename() == target.name;
    EXPECT_TRUE(known) << entry.path();
  }
}

INSTANTIATE_TEST_SUITE_P(Reader, Fuzz, testing::ValuesIn([] {
                           std::vector<std::string> names;
                           for (const Target& target : targets()) names.emplace_back(target.name);
                           return names;
                         }()),
                         [](const auto& reader) { return reader.param; });

}  // namespace
}  // namespace lamina::fuzz

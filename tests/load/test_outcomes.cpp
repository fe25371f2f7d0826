// tests/load/test_outcomes.cpp: every file of the corpus, and of LAMINA_MODELS, ends as tests/corpus/outcomes.tsv says.
#include <set>

#include "tests/load/files.h"

namespace lamina::test {
namespace {

struct Row {
  std::string file, outcome, exit_code, same_as, message, comment;
};

std::vector<Row> table() {
  std::ifstream file(corpus("outcomes.tsv"));
  std::vector<Row> rows;
  std::string line;
  for (bool first = true; std::getline(file, line); first = false) {
    if (first || line.empty()) continue;
    std::vector<std::string> cells(1);
    for (const char c : line) {
      if (c == '\t') {
        cells.emplace_back();
      } else {
        cells.back() += c;
      }
    }
    EXPECT_EQ(cells.size(), 6u) << line;
    cells.resize(6);
    rows.push_back({cells[0], cells[1], cells[2], cells[3], cells[4], cells[5]});
  }
  return rows;
}

/// Part files below a folder, as the table names them.
std::set<std::string> files_below(const std::string& folder) {
  std::set<std::string> files;
  const std::set<std::string> kinds{".stl", ".obj", ".3mf", ".gz"};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && kinds.count(entry.path().extension().string()) > 0)
      files.insert(std::filesystem::relative(entry.path(), folder).string());
  return files;
}

TEST(Outcomes, EveryFileHasARow) {
  std::set<std::string> rows;
  for (const Row& row : table()) EXPECT_TRUE(rows.insert(row.file).second) << row.file << " has two rows";
  for (const std::string& file : files_below(corpus(""))) EXPECT_EQ(rows.count(file), 1u) << file;
  if (const char* const models = std::getenv("LAMINA_MODELS")) {
    for (const std::string& file : files_below(models)) EXPECT_EQ(rows.count(file), 1u) << file;
  }
}

TEST(Outcomes, EveryFileEndsAsItsRowSays) {
  std::size_t checked = 0;
  for (const Row& row : table()) {
    const std::string path = find_model(row.file);
    if (path.empty()) continue;
    SCOPED_TRACE(row.file);
    ++checked;
    const Result<Part> part = load::load(path, {});
    std::string said;
    if (part) {
      const bool repaired = std::any_of(part->notes.begin(), part->notes.end(), [](const Note& n) { return n.repair; });
      EXPECT_EQ(row.outcome, repaired ? "repaired" : "planned") << notes_of(*part);
      EXPECT_EQ(row.exit_code, "0");
      said = notes_of(*part);
    } else {
      EXPECT_EQ(row.outcome, "refused") << part.error().message;
      EXPECT_EQ(row.exit_code, std::to_string(static_cast<int>(part.error().fault)));
      said = part.error().message;
    }
    if (row.message != "-") {
      EXPECT_CONTAINS(said, row.message);
    }
    if (row.same_as == "-" || !part) continue;
    const std::string clean = find_model(row.same_as);
    if (!clean.empty()) {
      EXPECT_TRUE(placed(*part) == placed(loaded(clean))) << "differs from " << row.same_as;
    }
  }
  EXPECT_GT(checked, 30u) << "the table or the corpus is gone";
}

TEST(Outcomes, ModelsOutsideTheRepositoryAreCheckedToo) {
  if (std::getenv("LAMINA_MODELS") == nullptr)
    GTEST_SKIP() << "LAMINA_MODELS is not set: only the small models of tests/corpus were checked";
  for (const Row& row : table()) EXPECT_FALSE(find_model(row.file).empty()) << row.file << " has a row but is nowhere";
}

}  // namespace
}  // namespace lamina::test

// The page of a finished job gives the warnings of lamina jet, with the same words and cause.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

using Json = nlohmann::json;

class ReportedWarnings : public ::testing::Test {
 protected:
  void SetUp() override {
    write_box(directory_ / "a.stl", {0, 0, 0}, {10, 8, 1});
    write_box(directory_ / "b.stl", {0, 0, 0}, {5, 5, 0.5F});
    write_box(directory_ / "thin.stl", {0, 0, 0}, {8, 0.4F, 1});
  }
  Outcome run(const std::string& line) const { return run_lamina(words_of(line), directory_.path()); }
  static std::set<std::string> texts(const Json& warnings, const std::set<std::string>& without = {}) {
    std::set<std::string> all;
    for (const Json& warning : warnings) {
      if (!without.contains(warning["code"]))
        all.insert(warning["code"].get<std::string>() + ": " + std::string(warning["text"]));
    }
    return all;
  }
  Json page() const {
    const Outcome outcome = run("report out -o page.html --quiet --overwrite");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const std::string text = read_text(directory_ / "page.html"), begin = "<script id=\"head\" type=\"application/json\">";
    const std::size_t at = text.find(begin) + begin.size();
    return Json::parse(text.substr(at, text.find("</script>", at) - at))["warnings"];
  }
  Json jet(const std::string& line) const {
    const Outcome outcome = run("jet " + line + " --json --overwrite -o out");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out)["warnings"];
  }
  /// The page has the warnings of the job, and these codes are among them.
  void expect_alike(const std::string& line, const std::set<std::string>& codes) const {
    SCOPED_TRACE(line);
    const Json reported = jet(line);
    std::set<std::string> found;
    for (const Json& warning : reported) found.insert(warning["code"]);
    for (const std::string& code : codes) EXPECT_TRUE(found.contains(code)) << code << reported.dump();
    EXPECT_EQ(texts(page()), texts(reported));
  }

  Directory directory_;
};

TEST_F(ReportedWarnings, ArePowdersDropsNozzlesAndMaintenanceOfTheJob) {
  write_text(directory_ / "two.toml",
             "inherits = \"nuferbj\"\n[machine]\nname = \"two\"\n[powder]\nmaterials = [\"steel\", \"bronze\"]\n");
  expect_alike("a.stl b.stl --machine two.toml --material steel,bronze --vat-rule majority --layer 0.1", {"mixed-powders"});
  write_text(
      directory_ / "idle.toml",
      "inherits = \"nuferbj\"\n[machine]\nname = \"idle\"\n[head]\nblocked = [10, 11, 12, 13]\nblocked_rule = \"neighbour\"\n"
      "max_drop_sweeps = 1\n[powder]\nmin_saturation_percent = 60\n[maintenance]\nspit_mm = [-40, 5]\n");
  expect_alike("a.stl --machine idle.toml --layer 0.1 --saturation 40 --allow-unbound",
               {"maintenance", "saturation", "lost-pixels"});
}

TEST_F(ReportedWarnings, OfPartsWithoutDropsAreThoseOfTheDose) {
  for (const char* percent : {"1", "0"}) {
    write_text(directory_ / "job.toml", std::string("[layers]\nthickness_mm = 0.1\n[machine]\nprofile = \"nuferbj\"\n[dose]\n"
                                                    "saturation_percent = 70\ndithered = false\n[run]\nallow_unbound = true\n"
                                                    "[[part]]\npath = \"a.stl\"\n[[part]]\npath = \"b.stl\"\n"
                                                    "saturation_percent = ") +
                                            percent + "\n");
    expect_alike("--job job.toml", {"no-drop"});
  }
}

TEST_F(ReportedWarnings, OfWhatTheBleedTakesNameTheBleed) {
  for (const char* more : {"", " --mirror xy", " --levels 4", " --layers 2:9"})
    expect_alike(std::string("thin.stl a.stl --bed 60x40 --dpi 300 --layer 0.1 --bleed 300") + more, {"vanished"});
  expect_alike("thin.stl a.stl --bed 60x40 --dpi 300 --layer 0.1 --bleed 300", {"bleed", "vanished"});
  expect_alike("a.stl --bed 60x40 --dpi 300 --layer 0.1 --bleed 2000", {"bleed"});
  // Without the part's file too, but for what was there before the bleed.
  const Json reported = jet("thin.stl a.stl --bed 60x40 --dpi 300 --layer 0.1 --bleed 300");
  std::filesystem::rename(directory_ / "thin.stl", directory_ / "moved.stl");
  EXPECT_EQ(texts(page()), texts(reported, {"vanished"}));
}

TEST_F(ReportedWarnings, FoldersOfPartsThatAreNotThereAreErrors) {
  jet("a.stl --bed 60x40 --dpi 300 --layer 0.1");
  expect_refused("report out -o page.html --parts nowhere", 3, "--parts: nowhere: no such file or folder", directory_);
}

TEST_F(ReportedWarnings, OfPartsThatAreImagesNoMeshIsSearched) {
  jet("a.stl --bed 60x40 --dpi 300 --layer 0.1");
  ASSERT_EQ(run("jet out --bed 60x40 --dpi 300 --layer 0.1 -o again").code, 0);
  for (const char* parts : {"", " --parts ."}) {
    const Outcome outcome = run(std::string("report again -o again.html --overwrite") + parts);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE((outcome.out + outcome.err).find("views are of the layers: out: consists of images"), std::string::npos)
        << outcome.out << outcome.err;
  }
}

TEST_F(ReportedWarnings, PagesThatCannotBeSmallEnoughAreReported) {
  jet("a.stl --bed 60x40 --dpi 300 --layer 0.1");
  const Outcome small = run("report out -o page.html --max-bytes 10");
  EXPECT_EQ(small.code, 0);
  EXPECT_NE(small.err.find("more than --max-bytes"), std::string::npos) << small.err;
  EXPECT_EQ(run("report out -o page.html --overwrite").err, "");
}

}  // namespace
}  // namespace lamina::test

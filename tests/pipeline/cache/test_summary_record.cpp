// tests/pipeline/cache/test_summary_record.cpp: a summary survives its record, with the names of the parts of today.
#include "pipeline/cache/summary_record.h"

#include <gtest/gtest.h>

#include <array>

#include "stages/support/text/json_text.h"

namespace lamina::pipeline {
namespace {

Summary example() {
  Summary summary;
  summary.format = "tiff-g4";
  summary.machine = "jet1000";
  summary.layer_text = "of 0.1 mm";
  summary.height_mm = 3.1;
  summary.layers_total = 31;
  summary.triangles = 12;
  summary.volume_mm3 = 71.9999999;
  summary.bytes_written = 12345;
  PartSummary part;
  part.path = "in/a.stl";
  part.copies = 2;
  part.triangles = 12;
  part.fingerprint = ~0ull;
  part.bounds = Box{{1, 2, 3}, {4, 5, -6}};
  part.notes = {{true, "12 open edges"}};
  summary.parts = {part, part};
  summary.parts[1].path = "b.stl";
  summary.warnings = {{"volume", "in/a.stl: negative volume; b.stl.gz is none, nor is bb.stl", "in/a.stl", 3, 0.35},
                      {"other", "a.stl and b.stl."}};
  summary.head = {{"grid", "of a.stl"}};
  summary.results = {{"volume", "72 mm3"}};
  summary.end = {{"cost", "(b.stl) 3 EUR"}};
  summary.facts = Json{{"cost", {{"part", "b.stl"}, {"price", 3.5}}}, {"list", Json::array({1, "a.stl"})}};
  return summary;
}

TEST(SummaryRecord, IsTheSummaryAgain) {
  const Summary summary = example();
  const std::array<std::string, 2> paths = {"in/a.stl", "b.stl"};
  const Summary again = summary_of_record(parse_json(json_line(summary_record(summary))), paths);
  EXPECT_EQ(again.json(), summary.json());
  EXPECT_EQ(again.text(), summary.text());
  EXPECT_EQ(again.parts[0].fingerprint, ~0ull);
}

TEST(SummaryRecord, NamesOfPartsAreReplacedWhereTheyAreWholeNames) {
  const std::array<std::string, 2> paths = {"b.stl", "new/c.stl"};  // the first has the former name of the second
  const Summary again = summary_of_record(summary_record(example()), paths);
  EXPECT_EQ(again.parts[0].path, "b.stl");
  EXPECT_EQ(again.parts[1].path, "new/c.stl");
  EXPECT_EQ(again.warnings[0].text, "b.stl: negative volume; b.stl.gz is none, nor is bb.stl");
  EXPECT_EQ(again.warnings[0].part, "b.stl");
  EXPECT_EQ(again.warnings[1].text, "b.stl and new/c.stl.");
  EXPECT_EQ(again.head[0].second, "of b.stl");
  EXPECT_EQ(again.end[0].second, "(new/c.stl) 3 EUR");
  EXPECT_EQ(again.facts.at("cost").at("part").text(), "new/c.stl");
  EXPECT_EQ(again.facts.at("list").at(1).text(), "b.stl");
}

TEST(SummaryRecord, ARecordOfAnotherJobIsRefused) {
  const std::array<std::string, 1> paths = {"a.stl"};
  EXPECT_THROW(summary_of_record(summary_record(example()), paths), JsonError);
  EXPECT_THROW(summary_of_record(Json(), paths), JsonError);
}

}  // namespace
}  // namespace lamina::pipeline

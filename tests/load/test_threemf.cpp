// tests/load/test_threemf.cpp: 3MF packages, right and wrong.
#include <fmt/format.h>

#include <cmath>

#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

std::string write_3mf(const std::string& resources, const std::string& build, const std::string& unit = "millimeter") {
  return write_file("part.3mf", zip(package(model(resources, build, unit))));
}

Part box_at(std::array<float, 3> lo, std::array<float, 3> hi) {
  return loaded(write_file("expected.stl", binary_stl(box_facets(lo, hi))));
}

double volume(const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const Triangle& t : triangles) {
    sum += mm(t.a.x) * (mm(t.b.y) * mm(t.c.z) - mm(t.b.z) * mm(t.c.y)) +
           mm(t.a.y) * (mm(t.b.z) * mm(t.c.x) - mm(t.b.x) * mm(t.c.z)) +
           mm(t.a.z) * (mm(t.b.x) * mm(t.c.y) - mm(t.b.y) * mm(t.c.x));
  }
  return sum / 6;
}

TEST(Read3mf, ABoxIsABox) {
  const Part part = loaded(write_3mf(box_object(1, 10, 20, 30), item(1)));
  EXPECT_EQ(placed(part), placed(box_at({0, 0, 0}, {10, 20, 30})));
  EXPECT_TRUE(part.notes.empty()) << notes_of(part);
}

TEST(Read3mf, NameDoesNotDecide) {
  const std::string path = write_file("part.stl", zip(package(model(box_object(1, 10, 20, 30), item(1)))));
  EXPECT_EQ(loaded(path).meshes[0].triangles.size(), 12u);
}

TEST(Read3mf, EveryUnitOfTheFormatIsKnown) {
  const std::vector<std::pair<std::string, double>> units{{"micron", 0.001}, {"millimeter", 1}, {"centimeter", 10},
                                                          {"inch", 25.4},    {"foot", 304.8},   {"meter", 1000}};
  for (const auto& [unit, mm_of_unit] : units) {
    const Part part = loaded(write_3mf(box_object(1, 1, 1, 2), item(1), unit));
    EXPECT_EQ(part.bounds.hi.x, static_cast<Nm>(mm_of_unit * 1e6)) << unit;
  }
  EXPECT_EQ(loaded(corpus("broken/unit_meters.3mf")).bounds.hi, (Point3{10'000'000, 20'000'000, 30'000'000}));
}

TEST(Read3mf, UnitScalesTranslationsToo) {
  const Part part = loaded(write_3mf(box_object(1, 1, 1, 1), item(1, "1 0 0 0 1 0 0 0 1 2 3 4"), "inch"));
  EXPECT_EQ(part.bounds.lo, (Point3{50'800'000, 76'200'000, 101'600'000}));
}

TEST(Read3mf, TransformIsRowVectorTimesMatrix) {
  // x goes to y, y to z, z to x.
  const Part part = loaded(write_3mf(box_object(1, 10, 20, 30), item(1, "0 1 0 0 0 1 1 0 0 5 6 7")));
  EXPECT_EQ(part.bounds.lo, (Point3{5'000'000, 6'000'000, 7'000'000}));
  EXPECT_EQ(part.bounds.hi, (Point3{35'000'000, 16'000'000, 27'000'000}));
  EXPECT_GT(volume(placed(part)), 0);
}

TEST(Read3mf, MirroredItemsKeepTheirInsideInside) {
  const Part part = loaded(write_3mf(box_object(1, 10, 20, 30), item(1, "-1 0 0 0 1 0 0 0 1 0 0 0")));
  EXPECT_EQ(part.bounds.lo.x, -10'000'000);
  EXPECT_NEAR(volume(placed(part)), 6000, 1e-6);
  // This file's item turns and its mesh is inside out.
  EXPECT_NEAR(volume(placed(loaded(corpus("arrow_scaled_mirrored.3mf")))), 64991.37, 0.01);
  // Mirrored twice, by the item and by the job, it is as it was.
  load::LoadOptions options;
  options.transform = load::make_transform({-1, 1, 1}, {0, 0, 0}, {1, 1, 1});
  EXPECT_NEAR(volume(placed(loaded(write_3mf(box_object(1, 10, 20, 30), item(1, "-1 0 0 0 1 0 0 0 1 0 0 0")), options))), 6000,
              1e-6);
}

TEST(Read3mf, CopiesShareAMeshAndAreWhereTheyShould) {
  const Part part = loaded(write_3mf(box_object(1, 10, 20, 30),
                                     item(1) + item(1, "1 0 0 0 1 0 0 0 1 40 0 0") + item(1, "0 1 0 -1 0 0 0 0 1 0 50 0")));
  EXPECT_EQ(part.meshes.size(), 2u) << "the turned one has its own";
  ASSERT_EQ(part.instances.size(), 3u);
  EXPECT_EQ(part.bounds.hi.x, 50'000'000);
  EXPECT_EQ(placed(part).size(), 36u);
}

TEST(Read3mf, SharedMeshesEqualSnappingEachVertexWhereItIs) {
  // Translations that are no whole nanometres: sharing only where nothing differs.
  const Part part = loaded(write_3mf(box_object(1, 10, 20, 30), item(1) + item(1, "1 0 0 0 1 0 0 0 1 0.33333333 0 0") +
                                                                    item(1, "1 0 0 0 1 0 0 0 1 100.7 50.1 0")));
  std::vector<Triangle> expected;
  for (const double x : {0.0, 0.33333334, 100.7}) {
    load::LoadOptions options;
    options.transform.translation = {x, x > 100 ? 50.1 : 0.0, 0};
    for (const Triangle& t : placed(loaded(write_3mf(box_object(1, 10, 20, 30), item(1)), options))) expected.push_back(t);
  }
  Buffer<Triangle> all(expected.begin(), expected.end());
  EXPECT_EQ(placed(part), canonical(all));
}

TEST(Read3mf, ACopyThatSnapsDifferentlyHasItsOwnMesh) {
  std::string resources = box_object(1, 10, 20, 30);
  const std::size_t vertex = resources.find("<vertex x=\"0\" y=\"20\" z=\"30\"/>");
  ASSERT_NE(vertex, resources.npos);
  resources.replace(vertex, 13, "<vertex x=\"0.0000004\"");
  const Part part = loaded(write_3mf(resources, item(1) + item(1, "1 0 0 0 1 0 0 0 1 0.0000003 0 0")));
  ASSERT_EQ(part.meshes.size(), 2u) << "0.4 nm + 0.3 nm is 1 nm, though each alone is 0";
  EXPECT_NE(part.meshes[0].fingerprint, part.meshes[1].fingerprint);
  EXPECT_EQ(part.meshes[0].bounds.lo, part.meshes[1].bounds.lo);
}

TEST(Read3mf, ComponentsNestAndMultiplyTheirTransforms) {
  const std::string resources = box_object(1, 10, 20, 30) +
                                components(2, component(1) + component(1, "1 0 0 0 1 0 0 0 1 20 0 0")) +
                                components(3, component(2) + component(2, "1 0 0 0 1 0 0 0 1 0 50 0"));
  const Part part = loaded(write_3mf(resources, item(3, "2 0 0 0 2 0 0 0 2 0 0 0")));
  EXPECT_EQ(part.instances.size(), 4u);
  EXPECT_EQ(part.bounds.hi, (Point3{60'000'000, 140'000'000, 60'000'000}));
  EXPECT_NEAR(volume(placed(part)), 4 * 8 * 6000, 1e-3);
}

TEST(Read3mf, ComponentsThatExpandToBillionsAreRefusedBeforeTheyDo) {
  std::string resources = box_object(1, 10, 20, 30);
  for (int id = 2; id < 42; ++id) resources += components(id, component(id - 1) + component(id - 1));
  EXPECT_CONTAINS(refusal(write_3mf(resources, item(41))), "components expand to more triangles than the limit");
  EXPECT_CONTAINS(refusal(write_3mf(resources, item(1))), "components expand to more than 1048576 objects") << "unused ones";
  std::string empty = "<object id=\"1\" type=\"model\"><mesh><vertices/><triangles/></mesh></object>";
  for (int id = 2; id < 42; ++id) empty += components(id, component(id - 1) + component(id - 1));
  EXPECT_CONTAINS(refusal(write_3mf(empty, item(41))), "components expand to more than 1048576 objects");
  std::string deep = box_object(1, 10, 20, 30);
  for (int id = 2; id < 2002; ++id) deep += components(id, component(id - 1));
  EXPECT_CONTAINS(refusal(write_3mf(deep, item(2001))), "nested more than 1000 deep");
}

TEST(Read3mf, ComponentsThatExpandToBillionsAreFoundHoweverTheyAreWritten) {
  const auto doubled = [](const std::string& before_id, const std::string& behind_id, int levels) {
    std::string resources = box_object(1, 10, 20, 30);
    for (int id = 2; id < levels; ++id) {
      const std::string part = fmt::format("<component objectid=\"{}{}\"/>", id % 2 ? "0" : "", id - 1);
      resources += fmt::format("<object {}id=\"{}\"{} type=\"model\"><components>{}{}</components></object>", before_id, id,
                               behind_id, part, part);
    }
    return resources;
  };
  const std::string why = "components expand to more";
  for (const std::string& before : {std::string("name=\">\" "), std::string("name=' id=\"7\" > '\n"),
                                    std::string("name=\"-->\" "), std::string("partnumber=\"&lt;object id='1'>\" ")}) {
    EXPECT_CONTAINS(refusal(write_3mf(doubled(before, "", 42), item(41))), why) << before;
    EXPECT_CONTAINS(refusal(write_3mf(doubled("", " " + before, 42), item(41))), why) << before;
  }
  EXPECT_CONTAINS(refusal(write_3mf(doubled("partnumber=\"<object id='1'>\" ", "", 42), item(41))), "not well-formed");
  EXPECT_CONTAINS(refusal(write_3mf("<!-- > -->" + doubled("", "", 42), item(41))), why);
  EXPECT_CONTAINS(refusal(write_3mf(doubled("name=\"" + std::string(2u << 20, 'x') + "\" ", "", 3), item(2))),
                  "a tag of more than");
  // Written as character references.
  std::string coded = box_object(1, 10, 20, 30);
  for (int id = 2; id < 10; ++id) coded += components(id, component(id - 1) + component(id - 1));
  for (int id = 10; id < 50; ++id) {
    const std::string part = fmt::format("<component objectid=\"&#{};&#x{:x};\"/>", 48 + (id - 1) / 10, 48 + (id - 1) % 10);
    coded += components(id, id == 10 ? component(9) : part + part);
  }
  EXPECT_CONTAINS(refusal(write_3mf(coded, item(49))), why);
  // The model under another name, which the relationships state.
  for (const std::string& name : {std::string("3D/3dmodel.MODEL"), std::string("3D/model.xml")}) {
    auto entries = package(model(doubled("", "", 42), item(41)));
    for (auto& [entry, text] : entries) {
      if (entry.ends_with(".model")) entry = name;
      for (std::size_t at; (at = text.find("3D/3dmodel.model")) != text.npos;) text.replace(at, 16, name);
    }
    EXPECT_CONTAINS(refusal(write_file("named.3mf", zip(entries))), why) << name;
  }
  // A path that leads to a small object of that id, for readers that know paths, and to a large one for others.
  auto entries = package(model(doubled("", " ", 42),
                               "<item objectid=\"41\" p:path=\"/3D/other.model\" "
                               "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\"/>"));
  entries.push_back({"3D/other.model", model(box_object(41, 1, 1, 1), "")});
  EXPECT_CONTAINS(refusal(write_file("path.3mf", zip(entries))), why);
}

TEST(Read3mf, ModelsThatCannotBeScannedAreRefused) {
  auto entries = package(model(box_object(1, 1, 1, 1), item(1)));
  for (auto& [entry, text] : entries) {
    if (!entry.ends_with(".model")) continue;
    const std::string plain = text;
    text = "<!DOCTYPE model [<!ENTITY one \"1\">]>" + plain.substr(plain.find("?>") == plain.npos ? 0 : plain.find("?>") + 2);
    EXPECT_CONTAINS(refusal(write_file("type.3mf", zip(entries))), "has a document type");
    text = "\xFF\xFE";
    for (const char c : plain) text += c, text += '\0';
    EXPECT_CONTAINS(refusal(write_file("utf16.3mf", zip(entries))), "is UTF-16");
  }
}

TEST(Read3mf, ComponentsThatContainThemselvesAreRefused) {
  EXPECT_CONTAINS(refusal(write_3mf(box_object(1, 1, 1, 1) + components(2, component(2)), item(2))), "contains itself");
  EXPECT_CONTAINS(refusal(write_3mf(components(2, component(3)) + components(3, component(2)), item(2))), "contains itself");
}

TEST(Read3mf, SupportsAndOtherItemsAreNoted) {
  const Part part =
      loaded(write_3mf(box_object(1, 10, 20, 30) + box_object(2, 99, 99, 99, "type=\"support\""), item(1) + item(2)));
  EXPECT_EQ(part.instances.size(), 1u);
  EXPECT_CONTAINS(notes_of(part), "1 object is not planned: support");
}

TEST(Read3mf, WhatHasNothingToPrintIsRefused) {
  EXPECT_FALSE(refusal(write_3mf(box_object(1, 1, 1, 1), "")).empty());
  EXPECT_FALSE(refusal(write_3mf(box_object(1, 1, 1, 1, "type=\"support\""), item(1))).empty());
  EXPECT_FALSE(refusal(write_3mf(box_object(1, 1, 1, 1), item(7))).empty());
  EXPECT_FALSE(refusal(write_file("none.3mf", zip({{"a.txt", "hello"}}))).empty());
  EXPECT_FALSE(refusal(write_file("none.3mf", zip({}))).empty());
}

TEST(Read3mf, CoordinatesBeyondReachNameObjectAndTriangle) {
  EXPECT_CONTAINS(refusal(write_3mf(box_object(5, 1, 1, 3000, "type=\"model\" name=\"tower\""), item(5))),
                  "object 5 \"tower\", triangle 3: a coordinate is beyond the reach");
}

TEST(Read3mf, BombsAreRefusedBeforeTheyAreRead) {
  auto entries = package(model(box_object(1, 1, 1, 1), item(1)));
  entries.back().second += std::string(80u << 20, ' ');
  EXPECT_CONTAINS(refusal(write_file("bomb.3mf", zip(entries))), "expands more than 200-fold");
  load::LoadOptions options;
  options.expanded_limit = 100;
  EXPECT_CONTAINS(refusal(write_3mf(box_object(1, 1, 1, 1), item(1)), options), "expands to more than the limit of 100 bytes");
}

TEST(Read3mf, NumbersMeanWhatTheyMeanInOtherTextFormats) {
  std::string resources = box_object(1, 1, 1, 30);
  for (std::size_t at = 0; (at = resources.find("z=\"30\"", at)) != resources.npos;) resources.replace(at, 6, "z=\"0.03\"");
  for (const char* unit : {"meter", "inch", "millimeter"}) {
    const Part part = loaded(write_3mf(resources, item(1, "1 0 0 0 1 0 0 0 1 0.1 0.2 0.7"), unit));
    const double mm_of_unit = unit[1] == 'e' ? 1000 : unit[1] == 'n' ? 25.4 : 1;
    EXPECT_EQ(part.bounds.hi.z, std::llround(0.73 * mm_of_unit * 1e6)) << unit;
    EXPECT_EQ(part.bounds.lo.x, std::llround(0.1 * mm_of_unit * 1e6)) << unit;
  }
}

TEST(Read3mf, XmlEntitiesDoNotExpand) {
  std::string text = model(box_object(1, 1, 1, 1), item(1));
  std::string entities = "<!DOCTYPE model [<!ENTITY a \"aaaaaaaaaa\">";
  for (char c = 'b'; c < 'k'; ++c) {
    const std::string before(1, static_cast<char>(c - 1));
    entities += "<!ENTITY " + std::string(1, c) + " \"";
    for (int i = 0; i < 10; ++i) entities += "&" + before + ";";
    entities += "\">";
  }
  text.insert(text.find("?>") + 2, entities + "]>");
  const Result<Part> part = load::load(write_file("laughs.3mf", zip(package(text))), {});
  if (!part) {
    EXPECT_EQ(part.error().fault, Fault::kInput);
  }
}

TEST(Read3mf, EncryptedAndDamagedEntriesAreRefused) {
  const auto entries = package(model(box_object(1, 1, 1, 1), item(1)));
  EXPECT_CONTAINS(refusal(write_file("secret.3mf", zip(entries, 1))), "is encrypted");
  std::string damaged = zip(entries);
  damaged[damaged.find("3D/3dmodel.model") + 40] ^= 0x55;
  EXPECT_CONTAINS(refusal(write_file("damaged.3mf", damaged)), "is damaged");
}

TEST(Read3mf, TruncatedAtEveryLengthIsRefused) {
  const std::string whole = zip(package(model(box_object(1, 1, 1, 1), item(1))));
  for (std::size_t length = 0; length < whole.size(); ++length)
    ASSERT_FALSE(refusal(write_file("cut.3mf", whole.substr(0, length))).empty()) << length;
}

}  // namespace
}  // namespace lamina::test

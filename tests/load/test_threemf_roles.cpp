// tests/load/test_threemf_roles.cpp: modifiers, negative volumes and cavities of 3MF files are not planned as solids.
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <tuple>

#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

std::string roles_file(const std::string& model, const std::string& settings_name = {}, const std::string& settings = {}) {
  auto entries = package(model);
  if (!settings_name.empty()) entries.push_back({settings_name, settings});
  return write_file("roles.3mf", zip(entries));
}

/// Two boxes in one mesh, as PrusaSlicer writes the volumes of an object: triangles 0 to 11 and 12 to 23.
std::string two_volumes(const std::string& in_mesh = {}) {
  std::string first = box_object(1, 10, 20, 30), second = box_object(1, 40, 5, 5);
  const auto part = [](const std::string& text, const std::string& name) {
    const std::size_t at = text.find("<" + name + ">") + name.size() + 2;
    return text.substr(at, text.find("</" + name + ">") - at);
  };
  std::string triangles = part(second, "triangles");
  for (std::size_t at = 0; (at = triangles.find("=\"", at)) != triangles.npos;) {
    at += 2;
    triangles.replace(at, 1, std::to_string(triangles[at] - '0' + 8));
  }
  return "<object id=\"1\" name=\"bracket\"><mesh><vertices>" + part(first, "vertices") + part(second, "vertices") +
         "</vertices><triangles>" + part(first, "triangles") + triangles + "</triangles>" + in_mesh + "</mesh></object>";
}

std::string prusa_settings(const std::string& type, int last = 23) {
  return fmt::format(
      "<config><object id=\"1\" instances_count=\"1\"><volume firstid=\"0\" lastid=\"11\"><metadata type=\"volume\" "
      "key=\"volume_type\" value=\"ModelPart\"/></volume><volume firstid=\"12\" lastid=\"{}\"><metadata type=\"volume\" "
      "key=\"name\" value=\"hole\"/>{}</volume></object></config>",
      last, type);
}

std::string volume_type(const char* type) {
  return fmt::format("<metadata type=\"volume\" key=\"volume_type\" value=\"{}\"/>", type);
}

const std::string kPrusa = "Metadata/Slic3r_PE_model.config";

TEST(Read3mfRoles, ModifiersOfPrusaSlicerAreLeftOut) {
  const std::string text = model(two_volumes(), item(1));
  const Part plain = loaded(roles_file(model(box_object(1, 10, 20, 30), item(1))));
  EXPECT_EQ(placed(loaded(roles_file(text))).size(), 24u);
  EXPECT_EQ(placed(loaded(roles_file(text, kPrusa, prusa_settings(volume_type("ModelPart"))))).size(), 24u);
  for (const char* type : {"ParameterModifier", "SupportBlocker", "SupportEnforcer", "1", "SeamPosition"}) {
    const Part part = loaded(roles_file(text, kPrusa, prusa_settings(volume_type(type))));
    EXPECT_EQ(placed(part), placed(plain)) << type;
    EXPECT_CONTAINS(notes_of(part),
                    "object 1 \"bracket\": 1 of its volumes, such as 'hole', are modifiers or support blockers");
  }
  EXPECT_EQ(placed(loaded(roles_file(text, kPrusa, prusa_settings("<metadata key=\"modifier\" value=\"1\"/>")))),
            placed(plain));
}

TEST(Read3mfRoles, WhatTakesMaterialAwayIsRefused) {
  const std::string text = model(two_volumes(), item(1));
  EXPECT_CONTAINS(refusal(roles_file(text, kPrusa, prusa_settings(volume_type("NegativeVolume")))),
                  "object 1 \"bracket\" has 'hole', a negative volume that takes material away");
  EXPECT_CONTAINS(refusal(roles_file(text, kPrusa, prusa_settings(volume_type("SupportBlocker"), 24))),
                  "a volume 'hole' of triangles 12 to 24");
  const Part part = loaded(roles_file(text, kPrusa, "<config><object>"));
  EXPECT_CONTAINS(notes_of(part), "what this says of volumes is not known");
}

TEST(Read3mfRoles, VolumesOfSlic3rAreTreatedAlike) {
  const auto with = [](int modifier) {
    std::string text =
        model(two_volumes(fmt::format("<s:volumes><s:volume ts=\"0\" te=\"11\" modifier=\"0\"/><s:volume ts=\"12\" "
                                      "te=\"23\" modifier=\"{}\"/></s:volumes>",
                                      modifier)),
              item(1));
    return loaded(roles_file(text.insert(text.find("unit="), "xmlns:s=\"http://schemas.slic3r.org/3mf/2017/06\" ")));
  };
  EXPECT_EQ(placed(with(0)).size(), 24u);
  EXPECT_EQ(placed(with(1)).size(), 12u);
}

TEST(Read3mfRoles, PartsOfBambuStudioHaveTheirKinds) {
  const std::string text = model(box_object(1, 10, 20, 30) + box_object(2, 40, 5, 5, "type=\"other\"") +
                                     box_object(3, 1, 1, 1) + components(4, component(1) + component(2) + component(3)),
                                 item(4));
  const auto settings = [](const char* second, const char* third) {
    return fmt::format(
        "<config><object id=\"4\"><metadata key=\"name\" value=\"x\"/><part id=\"1\" subtype=\"normal_part\"/>"
        "<part id=\"2\" subtype=\"{}\"/><part id=\"3\" subtype=\"{}\"/></object></config>",
        second, third);
  };
  const std::string name = "Metadata/model_settings.config";
  EXPECT_EQ(placed(loaded(roles_file(text, name, settings("modifier_part", "normal_part")))).size(), 24u);
  const Part part = loaded(roles_file(text, name, settings("support_enforcer", "support_blocker")));
  EXPECT_EQ(placed(part).size(), 12u);
  EXPECT_CONTAINS(notes_of(part), "2 objects are not planned: modifier or support blocker");
  EXPECT_CONTAINS(refusal(roles_file(text, name, settings("negative_part", "normal_part"))), "object 2 is a negative volume");
}

TEST(Read3mfRoles, ModifiersOfCuraAreLeftOut) {
  const auto with = [](const std::string& settings) {
    std::string box = box_object(2, 40, 5, 5);
    box.insert(box.find("<mesh>"), settings);
    std::string text = model(box_object(1, 10, 20, 30) + box, item(1) + item(2));
    return loaded(
        roles_file(text.insert(text.find("unit="), "xmlns:cura=\"http://software.ultimaker.com/xml/cura/3mf/2015/10\" ")));
  };
  const auto now = [](const char* key, const char* value) {
    return fmt::format("<metadatagroup><metadata name=\"cura:{}\" type=\"xs:string\">{}</metadata></metadatagroup>", key,
                       value);
  };
  EXPECT_EQ(placed(with(now("infill_mesh", "False"))).size(), 24u);
  EXPECT_EQ(placed(with(now("extruder_nr", "1"))).size(), 24u);
  for (const char* key : {"infill_mesh", "cutting_mesh", "anti_overhang_mesh", "support_mesh"})
    EXPECT_EQ(placed(with(now(key, "True"))).size(), 12u) << key;
  const Part part = with("<settings><setting key=\"infill_mesh\">True</setting></settings>");
  EXPECT_CONTAINS(notes_of(part), "1 object is not planned: modifier or support blocker of the program that wrote the file");
}

/// Turns the facets of an object over.
std::string turned_inside_out(std::string box) {
  for (std::size_t at = 0; (at = box.find("v2=", at)) != box.npos; at += 3) {
    box[at + 1] = '3';
    at = box.find("v3=", at + 3);
    box[at + 1] = '2';
  }
  return box;
}

std::int64_t cubic_mm(const Part& part) {
  double sum = 0;
  for (const Triangle& t : placed(part)) {
    sum += mm(t.a.x) * (mm(t.b.y) * mm(t.c.z) - mm(t.b.z) * mm(t.c.y)) +
           mm(t.a.y) * (mm(t.b.z) * mm(t.c.x) - mm(t.b.x) * mm(t.c.z)) +
           mm(t.a.z) * (mm(t.b.x) * mm(t.c.y) - mm(t.b.y) * mm(t.c.x));
  }
  return std::llround(sum / 6);
}

TEST(Read3mfRoles, InsideOutWithinAnotherObjectIsAVoid) {
  const std::string inner = turned_inside_out(box_object(2, 4, 4, 4, "name=\"pore\"")), outer = box_object(1, 10, 10, 10);
  const auto assembled = [&](const std::string& position, const std::string& mirror = "") {
    return loaded(roles_file(model(outer + inner + components(3, component(1) + component(2, position)), item(3, mirror))));
  };
  const std::string within = "1 0 0 0 1 0 0 0 1 3 3 3", neighbour = "1 0 0 0 1 0 0 0 1 20 3 3",
                    across = "1 0 0 0 1 0 0 0 1 8 3 3";
  const Part part = assembled(within);
  EXPECT_EQ(cubic_mm(part), 1000 - 64);
  EXPECT_CONTAINS(notes_of(part), "object 2 \"pore\" is inside out within another object of its build item: it is a void");
  EXPECT_EQ(cubic_mm(assembled(within, "-1 0 0 0 1 0 0 0 1 0 0 0")), 1000 - 64) << "mirrored";
  EXPECT_EQ(cubic_mm(assembled(neighbour)), 1000 + 64);
  EXPECT_EQ(cubic_mm(assembled(across)), 1000 + 64) << "it leaves the solid";
  // Items are merged after each of them is filled.
  const Part items = loaded(roles_file(model(outer + inner, item(1) + item(2, within))));
  EXPECT_EQ(cubic_mm(items), 1000 + 64);
  EXPECT_CONTAINS(notes_of(items), "is turned over");
}

TEST(Read3mfRoles, ACavityOfOneItemIsASolidOfAnother) {
  const std::string inner = turned_inside_out(box_object(2, 4, 4, 4)), outer = box_object(1, 10, 10, 10);
  const std::string within = "1 0 0 0 1 0 0 0 1 3 3 3", away = "1 0 0 0 1 0 0 0 1 30 0 0";
  const Part part =
      loaded(roles_file(model(outer + inner + components(3, component(1) + component(2, within)), item(3) + item(2, away))));
  EXPECT_EQ(cubic_mm(part), 1000 - 64 + 64);
  EXPECT_EQ(part.meshes.size(), 2u);
  const Part copies = loaded(roles_file(model(outer + inner + components(3, component(1) + component(2, within)),
                                              item(3) + item(3, away) + item(3, "0 1 0 -1 0 0 0 0 1 0 0 0"))));
  EXPECT_EQ(copies.meshes.size(), 2u) << "one for each turn";
  EXPECT_EQ(copies.instances.size(), 3u);
  EXPECT_EQ(cubic_mm(copies), 3 * (1000 - 64));
}

TEST(Read3mfRoles, AVoidStaysAVoidWhereItsContainerHasAnOpening) {
  std::string outer = box_object(1, 10, 10, 10);
  const std::size_t last = outer.rfind("<triangle ");
  outer.erase(last, outer.find("/>", last) + 2 - last);
  const std::string inner = turned_inside_out(box_object(2, 4, 4, 4));
  const Part part =
      loaded(roles_file(model(outer + inner + components(3, component(1) + component(2, "1 0 0 0 1 0 0 0 1 3 3 3")), item(3))));
  EXPECT_EQ(cubic_mm(part), 1000 - 64);
  EXPECT_EQ(part.meshes.size(), 1u);
  EXPECT_CONTAINS(notes_of(part), "it is a void");
  EXPECT_CONTAINS(notes_of(part), "1 opening capped");
}

TEST(Read3mfRoles, AVoidIsFoundInTurnedScaledAndMirroredCopies) {
  const std::string inner = turned_inside_out(box_object(2, 4, 4, 4)), outer = box_object(1, 10, 10, 10);
  for (const auto& [position, hole, volume] : std::vector<std::tuple<std::string, std::string, int>>{
           {"0 1 0 -1 0 0 0 0 1 10 0 0", "1 0 0 0 1 0 0 0 1 3 3 3", 1000 - 64},
           {"-1 0 0 0 1 0 0 0 1 10 0 0", "1 0 0 0 1 0 0 0 1 3 3 3", 1000 - 64},
           {"20 0 0 0 2 0 0 0 1 50 0 0", "1 0 0 0 1 0 0 0 1 53 3 3", 40'000 - 64},
           {"0.6 0.8 0 -0.8 0.6 0 0 0 1 0 0 0", "0.5 0 0 0 0.5 0 0 0 1 -2 6 3", 1000 - 16}}) {
    const Part part =
        loaded(roles_file(model(outer + inner + components(3, component(1, position) + component(2, hole)), item(3))));
    EXPECT_EQ(cubic_mm(part), volume) << position;
    EXPECT_CONTAINS(notes_of(part), "it is a void");
  }
}

/// Copies of a large object at one place, none of which holds the void in the corner of its box, and one that does.
TEST(Read3mfRoles, CopiesThatMightHoldAVoidCostNoTreeEach) {
  constexpr int kSides = 1000, kCopies = 500;
  std::string vertices = "<vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"10\"/>", triangles;
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSides;
    vertices += fmt::format("<vertex x=\"{:.6f}\" y=\"{:.6f}\" z=\"0\"/>", 10 * std::cos(angle), 10 * std::sin(angle));
    const int one = 2 + i, next = 2 + (i + 1) % kSides;
    triangles +=
        fmt::format("<triangle v1=\"0\" v2=\"{}\" v3=\"{}\"/><triangle v1=\"1\" v2=\"{}\" v3=\"{}\"/>", next, one, one, next);
  }
  const std::string cone = "<object id=\"1\"><mesh><vertices>" + vertices + "</vertices><triangles>" + triangles +
                           "</triangles></mesh></object>",
                    inner = turned_inside_out(box_object(2, 1, 1, 1)), outer = box_object(4, 2, 2, 2);
  std::string many;
  for (int i = 0; i < kCopies; ++i) many += component(1);
  many += component(4, "1 0 0 0 1 0 0 0 1 -9.8 -9.8 7.5") + component(2, "1 0 0 0 1 0 0 0 1 -9.3 -9.3 8");
  const Part part = loaded(roles_file(model(cone + inner + outer + components(3, many), item(3))));
  EXPECT_CONTAINS(notes_of(part), "it is a void");
  EXPECT_EQ(part.meshes.size(), 2u);
  EXPECT_EQ(part.instances.size(), kCopies + 1u);
}

}  // namespace
}  // namespace lamina::test

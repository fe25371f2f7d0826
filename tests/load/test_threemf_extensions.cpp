// tests/load/test_threemf_extensions.cpp: content of a 3MF file other than core meshes is read, reported or refused by name.
#include <fmt/format.h>

#include "stages/load/threemf/archive.h"
#include "stages/support/text/escape.h"
#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

const std::string kSpaces =
    "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" "
    "xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\" "
    "xmlns:s=\"http://schemas.microsoft.com/3dmanufacturing/slice/2015/07\" "
    "xmlns:v=\"http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01\" ";

std::string with(const std::string& attributes, const std::string& resources, const std::string& build) {
  std::string text = model(resources, build);
  text.insert(text.find("unit="), kSpaces + attributes + " ");
  return text;
}

std::string written(const std::string& text) { return write_file("part.3mf", zip(package(text))); }

/// A box with something in its mesh, behind the triangles.
std::string box_with(const std::string& inside, const std::string& attributes = "type=\"model\"") {
  std::string box = box_object(1, 10, 20, 30, attributes);
  return box.insert(box.find("</mesh>"), inside);
}

const std::string kLattice =
    "<b:beamlattice radius=\"1\" minlength=\"0.1\"><b:beams><b:beam v1=\"0\" v2=\"7\"/><b:beam v1=\"1\" v2=\"6\"/></b:beams>"
    "</b:beamlattice>";

TEST(Read3mfExtensions, WhatIsRequiredAndNotReadIsRefusedByName) {
  for (const auto& [space, name] :
       {std::pair{"http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01", "requires the extension volumetric"},
        {"http://schemas.microsoft.com/3dmanufacturing/displacement/2022/07", "requires the extension displacement"},
        {"http://schemas.3mf.io/3dmanufacturing/booleanoperations/2023/07", "requires the extension boolean operations"},
        {"http://schemas.microsoft.com/3dmanufacturing/securecontent/2019/04", "export it without encryption"},
        {"http://example.org/new", "requires the extension http://example.org/new"}}) {
    const std::string text =
        with(fmt::format("xmlns:e=\"{}\" requiredextensions=\"p e\"", space), box_object(1, 1, 1, 1), item(1));
    EXPECT_CONTAINS(refusal(written(text)), name);
  }
  EXPECT_CONTAINS(refusal(written(with("requiredextensions=\"x\"", box_object(1, 1, 1, 1), item(1)))), "of the prefix 'x'");
  EXPECT_EQ(placed(loaded(written(with("requiredextensions=\"p b s\"", box_object(1, 1, 1, 1), item(1))))).size(), 12u)
      << "required, and not used";
}

TEST(Read3mfExtensions, BeamsAreRefusedWhereRequiredAndReportedWhereNot) {
  EXPECT_CONTAINS(refusal(written(with("requiredextensions=\"b\"", box_with(kLattice), item(1)))),
                  "object 1 has 2 beams of the extension beam lattice");
  const Part part = loaded(written(with("", box_with(kLattice), item(1))));
  EXPECT_CONTAINS(notes_of(part), "object 1: 2 beams of a lattice");
  EXPECT_EQ(placed(part).size(), 12u);
  const std::string bare = "<object id=\"1\"><mesh><vertices/><triangles/>" + kLattice + "</mesh></object>";
  EXPECT_CONTAINS(refusal(written(with("", bare, item(1)))), "object 1 has 2 beams of the extension beam lattice");
}

TEST(Read3mfExtensions, SlicesAreNeverReplacedInSilence) {
  const std::string stack = "<s:slicestack id=\"5\"><s:slice ztop=\"1\"/></s:slicestack>";
  for (const char* attributes : {"s:slicestackid=\"5\" s:meshresolution=\"lowres\"", "s:slicestackid=\"5\""}) {
    EXPECT_CONTAINS(refusal(written(with("", stack + box_with("", attributes), item(1)))), "object 1 is defined by slices");
  }
  // Of full resolution, and more than the box around it.
  const std::string solid =
      "<object id=\"1\" s:slicestackid=\"5\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"9\" "
      "y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"9\" z=\"0\"/><vertex x=\"0\" y=\"0\" z=\"9\"/></vertices><triangles>"
      "<triangle v1=\"0\" v2=\"2\" v3=\"1\"/><triangle v1=\"0\" v2=\"1\" v3=\"3\"/><triangle v1=\"0\" v2=\"3\" "
      "v3=\"2\"/><triangle v1=\"1\" v2=\"2\" v3=\"3\"/></triangles></mesh></object>";
  EXPECT_CONTAINS(notes_of(loaded(written(with("", stack + solid, item(1))))), "its mesh is planned, not its slices");
}

TEST(Read3mfExtensions, WhatIsOnlyUsedIsReported) {
  const Part part = loaded(written(with("", "<v:image3d id=\"9\"/>" + box_object(1, 1, 1, 1), item(1))));
  EXPECT_CONTAINS(notes_of(part), "holds elements of the extension volumetric");
  const std::string strange = "<object id=\"1\"><v:levelset/></object>";
  EXPECT_CONTAINS(refusal(written(with("", strange, item(1)))), "object 1 consists of geometry of the extension volumetric");
}

TEST(Read3mfExtensions, PathsLeadToOtherFilesWithTheirOwnUnitsAndIds) {
  const std::string component =
      "<component objectid=\"1\" p:path=\"/3D/Objects/Object%201.model\" "
      "transform=\"1 0 0 0 1 0 0 0 1 1 2 3\"/>";
  auto entries = package(with("requiredextensions=\"p\"", components(2, component), item(2)));
  entries.push_back({"3D/Objects/object 1.MODEL", model(box_object(1, 1, 1, 2, "name=\"a\""), "", "inch")});
  const Part part = loaded(write_file("path.3mf", zip(entries)));
  EXPECT_EQ(part.bounds.lo, (Point3{1'000'000, 2'000'000, 3'000'000}));
  EXPECT_EQ(part.bounds.hi, (Point3{26'400'000, 27'400'000, 53'800'000}));
  EXPECT_CONTAINS(part.meshes[0].name, "object 1 \"a\" in 3d/objects/object 1.model");
  entries.pop_back();
  EXPECT_CONTAINS(refusal(write_file("path.3mf", zip(entries))),
                  "names 3d/objects/object 1.model, which the file does not contain");
}

TEST(Read3mfExtensions, PrefixesAndProgramsOwnDefaultsDoNotMatter) {
  std::string prefixed = model(box_object(0, 10, 20, 30), item(0));
  prefixed.replace(prefixed.find("xmlns="), 6, "xmlns:core=");
  for (std::size_t at = 0; (at = prefixed.find('<', at)) != prefixed.npos; ++at) {
    if (prefixed[at + 1] != '?') prefixed.insert(at + (prefixed[at + 1] == '/' ? 2 : 1), "core:");
  }
  EXPECT_EQ(placed(loaded(written(prefixed))).size(), 12u);
  std::string cura = model(box_object(1, 10, 20, 30), item(1));
  cura.replace(cura.find("xmlns="), 6, "xmlns=\"http://software.ultimaker.com/xml/cura/3mf/2015/10\" xmlns:cura=");
  EXPECT_EQ(placed(loaded(written(cura))).size(), 12u);
  EXPECT_CONTAINS(refusal(written("<html/>")), "is no 3MF model: it begins with <html>");
}

TEST(Read3mfExtensions, OnePackageHasOneModel) {
  auto entries = package(model(box_object(1, 1, 1, 1), item(1)));
  std::string& relationships = entries[1].second;
  const std::string two =
      "<Relationship Target=\"/3D/3dmodel.model\" Id=\"rel1\" "
      "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>";
  relationships.insert(relationships.find("</Relationships>"), two);
  EXPECT_CONTAINS(refusal(write_file("two.3mf", zip(entries))), "more than one 3D model");
  entries[1].second = "<Relationships/>";
  EXPECT_CONTAINS(refusal(write_file("none.3mf", zip(entries))), "is a zip file, but no 3MF: it names no 3D model");
  EXPECT_EQ(part_name("../A%2fb\\./c.Model", "/3d/x/"), "/3d/a/b/c.model");
}

TEST(Read3mfExtensions, WhatDoesNotFitTogetherIsRefusedWithItsLine) {
  const auto broken = [](const std::string& from, const std::string& to) {
    std::string text = model("\n" + box_object(1, 1, 1, 1), item(1));
    text.replace(text.find(from), from.size(), to);
    return refusal(written(text));
  };
  EXPECT_CONTAINS(broken("v1=\"0\"", "v1=\"8\""), "line 2: a triangle names vertex '8', of 8");
  EXPECT_CONTAINS(broken("v1=\"0\"", "v1=\"-1\""), "a triangle names vertex '-1'");
  EXPECT_CONTAINS(broken("v1=\"0\"", ""), "lacks v1, v2 or v3");
  EXPECT_CONTAINS(broken("x=\"1\"", ""), "lacks x, y or z");
  EXPECT_CONTAINS(broken("x=\"1\"", "x=\"1,5\""), "the coordinate '1,5' has a decimal comma");
  EXPECT_CONTAINS(broken("id=\"1\"", "id=\"x\""), "the id 'x' is no whole number");
  EXPECT_CONTAINS(broken("type=\"model\"", "type=\"thing\""), "the type 'thing' of an object");
  EXPECT_CONTAINS(broken("millimeter", "furlong"), "the unit 'furlong'");
  EXPECT_CONTAINS(broken("objectid=\"1\"", "objectid=\"1\" transform=\"1 0 0\""), "not of 12 numbers");
  EXPECT_CONTAINS(refusal(written(model(box_object(1, 1, 1, 1) + box_object(1, 1, 1, 1), item(1)))),
                  "a second resource of id 1");
  EXPECT_CONTAINS(refusal(written(model(box_object(1, 1, 1, 1, "type=\"other\""), item(1)))), "is of type \"other\"");
  std::string nested;
  for (int i = 0; i < 300; ++i) nested += "<a>";
  EXPECT_CONTAINS(refusal(written(model(nested, ""))), "nested more than 256 deep");
  std::string names;
  for (int i = 0; i < 5000; ++i) names += fmt::format("<name{}/>", i);
  EXPECT_CONTAINS(refusal(written(model(names, ""))), "more than 4096 different names");
}

TEST(Read3mfExtensions, ObjectsBehindTheirUseAreReadAndReported) {
  const Part part = loaded(written(model(components(1, component(2)) + box_object(2, 1, 1, 1), item(1))));
  EXPECT_EQ(placed(part).size(), 12u);
  EXPECT_CONTAINS(notes_of(part), "names objects before it holds them");
  const Part other = loaded(written(
      model(box_object(2, 1, 1, 1) + box_object(3, 9, 9, 9, "type=\"other\"") + components(1, component(2) + component(3)),
            item(1))));
  EXPECT_EQ(placed(other).size(), 12u);
  EXPECT_CONTAINS(notes_of(other), "1 object is not planned: type \"other\"");
}

TEST(Read3mfExtensions, AnObjectInsideOutIsTurnedOverAndNamed) {
  std::string box = box_object(7, 10, 20, 30, "name=\"cube\"");
  for (std::size_t at = 0; (at = box.find("v2=", at)) != box.npos;) {
    box[at + 1] = '3';
    at = box.find("v3=", at + 3);
    box[at + 1] = '2';
    at += 3;
  }
  const std::string mirrored = item(7, "-1 0 0 0 1 0 0 0 1 0 0 0");
  const Part part = loaded(written(model(box, item(7) + mirrored)));
  const Part expected = loaded(written(model(box_object(7, 10, 20, 30), item(7) + mirrored)));
  EXPECT_EQ(placed(part), placed(expected));
  EXPECT_CONTAINS(notes_of(part), "object 7 \"cube\" is inside out and is turned over");
  EXPECT_TRUE(expected.notes.empty()) << "mirrored items are not inside out";
  const std::string reported = notes_of(loaded(written(model(box, item(7) + item(7, "0 1 0 -1 0 0 0 0 1 0 50 0")))));
  EXPECT_EQ(reported.find("inside out"), reported.rfind("inside out")) << "once, whichever way it stands: " << reported;
  load::LoadOptions as_it_is;
  as_it_is.repair = false;
  const Part unturned = loaded(written(model(box, item(7))), as_it_is);
  EXPECT_LT(unturned.meshes[0].volume_mm3, 0);
  EXPECT_TRUE(unturned.notes.empty()) << notes_of(unturned);
}

TEST(Read3mfExtensions, AHundredThousandItemsTakeASecond) {
  std::string items;
  for (int i = 0; i < 100'000; ++i)
    items += fmt::format("<item objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 {} {} 0\"/>", 0.1 * (i % 1000),
                         0.33333333 * (i / 1000));
  const Part part = loaded(written(model(box_object(1, 1, 1, 1), items)));
  EXPECT_EQ(part.instances.size(), 100'000u);
  EXPECT_EQ(part.meshes.size(), 1u);
  // Where coordinates lie close to halves of a nanometre, each vertex decides.
  const std::string fine = box_object(1, 1, 1, 1);
  std::string odd = fine;
  for (std::size_t at = 0; (at = odd.find("x=\"1\"", at)) != odd.npos;) odd.replace(at, 5, "x=\"1.0000004\"");
  const Part split =
      loaded(written(model(odd, item(1) + item(1, "1 0 0 0 1 0 0 0 1 2.0000003 0 0") + item(1, "1 0 0 0 1 0 0 0 1 5 0 0"))));
  EXPECT_EQ(split.meshes.size(), 2u);
  EXPECT_EQ(split.instances.size(), 3u);
}

TEST(Read3mfExtensions, NumbersKeepAllTheirDigits) {
  std::string text = box_object(1, 1, 1, 1);
  for (std::size_t at = 0; (at = text.find("x=\"1\"", at)) != text.npos;) text.replace(at, 5, "x=\"1234.567891\"");
  EXPECT_EQ(loaded(written(model(text, item(1)))).bounds.hi.x, 1'234'567'891);
}

}  // namespace
}  // namespace lamina::test

// tests/load/test_threemf_rules.cpp: 3MF files that do not follow the specification are refused, or reported if programs write
// such ones and geometry is what it is.
#include <fmt/format.h>

#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

/// A box among resources of the materials extension.
std::string box_among(const std::string& resources, const std::string& attributes = "type=\"model\"") {
  std::string text = model(resources + box_object(90, 1, 1, 1, attributes), item(90));
  return text.insert(text.find("unit="), "xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" ");
}

std::string zipped_model(const std::string& text) { return write_file("rules.3mf", zip(package(text))); }

const std::string kBase = "<basematerials id=\"1\"><base name=\"PLA\" displaycolor=\"#0000FF\"/></basematerials>";
const std::string kColors = "<m:colorgroup id=\"3\"><m:color color=\"#FFFFFF\"/></m:colorgroup>";
const std::string kTexture = "<m:texture2d id=\"2\" path=\"/3D/a.png\" contenttype=\"image/png\"/>";
const std::string kGroup = "<m:texture2dgroup id=\"4\" texid=\"2\"><m:tex2coord u=\"0\" v=\"1\"/></m:texture2dgroup>";
const std::string kComposites =
    "<m:compositematerials id=\"5\" matid=\"1\" matindices=\"0\"><m:composite values=\"1\"/></m:compositematerials>";

std::string multi_of(const std::string& pids, int id = 6) {
  return fmt::format("<m:multiproperties id=\"{}\" pids=\"{}\"><m:multi pindices=\"0 0\"/></m:multiproperties>", id, pids);
}

TEST(Read3mfRules, SoundPropertiesAreWithoutANote) {
  const Part part = loaded(
      zipped_model(box_among(multi_of("1 3") + kComposites + kTexture + kGroup + kBase + kColors, "pid=\"1\" pindex=\"0\"")));
  EXPECT_EQ(placed(part).size(), 12u);
  EXPECT_EQ(notes_of(part), "") << "regardless of the order";
}

TEST(Read3mfRules, PropertiesThatLackSomethingAreRefusedWithLineAndSection) {
  const auto lacking = [](std::string text, const std::string& attribute) {
    const std::size_t at = text.find(" " + attribute + "=");
    text.erase(at, text.find('"', text.find('"', at) + 1) + 1 - at);
    return refusal(zipped_model(box_among(kBase + kTexture + "\n" + text)));
  };
  const auto all = [](const std::string& text, std::string from, int id) {
    std::string out = text;
    return out.replace(out.find(from), from.size(), fmt::format("id=\"{}\"", id));
  };
  EXPECT_CONTAINS(lacking(kColors, "color"), "line 2: <color> lacks its color, which 3MF requires (materials 2.1)");
  EXPECT_CONTAINS(lacking(kGroup, "texid"), "<texture2dgroup> lacks its texid");
  EXPECT_CONTAINS(lacking(kGroup, "v"), "<tex2coord> lacks its v");
  EXPECT_CONTAINS(lacking(kComposites, "matid"), "<compositematerials> lacks its matid");
  EXPECT_CONTAINS(lacking(kComposites, "matindices"), "<compositematerials> lacks its matindices");
  EXPECT_CONTAINS(lacking(multi_of("1"), "pids"), "<multiproperties> lacks its pids");
  EXPECT_CONTAINS(lacking(all(kTexture, "id=\"2\"", 9), "path"), "<texture2d> lacks its path");
  EXPECT_CONTAINS(lacking(all(kBase, "id=\"1\"", 9), "displaycolor"), "<base> lacks its displaycolor");
  EXPECT_CONTAINS(refusal(zipped_model(box_among("<m:texture2d id=\"2\" path=\"/a\" contenttype=\"\"/>"))), "the content type");
  EXPECT_CONTAINS(refusal(zipped_model(box_among("", "pindex=\"0\""))), "a pindex and no pid, which 3MF requires (core 4)");
}

TEST(Read3mfRules, PropertiesThatReferToTheWrongKindAreRefused) {
  const std::string sound = kBase + kColors + kTexture + kComposites;
  const auto refused = [&](const std::string& more) { return refusal(zipped_model(box_among(sound + "\n" + more))); };
  EXPECT_CONTAINS(refused("<m:compositematerials id=\"9\" matid=\"3\" matindices=\"0\"/>"),
                  "line 2: <compositematerials>: its matid");
  EXPECT_CONTAINS(refused("<m:texture2dgroup id=\"9\" texid=\"3\"/>"), "its texid leads to no <texture2d>");
  EXPECT_CONTAINS(refused(multi_of("1 5")), "more than one group of materials");
  EXPECT_CONTAINS(refused(multi_of("3 3")), "more than one <colorgroup>");
  EXPECT_CONTAINS(refused(multi_of("1 7") + multi_of("1", 7)), "refers to <multiproperties>");
}

TEST(Read3mfRules, WhatThe3dPayloadNamesIsInThePackage) {
  const auto with_relationship = [](const std::string& target, const std::string& type) {
    auto entries = package(model(box_object(1, 1, 1, 1), item(1)));
    entries.push_back(
        {"3D/_rels/3dmodel.model.rels",
         fmt::format("<Relationships><Relationship Id=\"a\" Target=\"{}\" Type=\"{}\"/></Relationships>", target, type)});
    return write_file("rels.3mf", zip(entries));
  };
  const std::string texture = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dtexture";
  EXPECT_CONTAINS(refusal(with_relationship("C:/Metadata/thumbnail.png", texture)), "lies outside of the file");
  EXPECT_CONTAINS(refusal(with_relationship("a.png\" TargetMode=\"External", texture)), "lies outside of the file");
  EXPECT_EQ(placed(loaded(with_relationship("Textures/a:b.png", texture))).size(), 12u) << "no scheme";
  EXPECT_EQ(placed(loaded(with_relationship("https://example.org/", "http://example.org/link"))).size(), 12u);
}

TEST(Read3mfRules, WhatProgramsOftenDoIsReported) {
  const auto reported = [](const std::string& before_resources, const std::string& in_mesh = "") {
    std::string text = box_among("");
    if (!in_mesh.empty()) text.insert(text.find("</triangles>"), in_mesh);
    const Part part = loaded(zipped_model(text.insert(text.find("<resources>"), before_resources)));
    EXPECT_EQ(placed(part).size(), 12u);
    return notes_of(part);
  };
  const std::string title = "<metadata name=\"Title\">a</metadata>";
  EXPECT_EQ(reported(title + "<metadata name=\"m:own\"/>"), "");
  EXPECT_CONTAINS(reported("<metadata name=\"Origin\"/><metadata name=\"CopyRight\"/>"),
                  "does not follow the 3MF specification, which does not change its geometry: metadata of a name that is "
                  "neither of 3MF nor of a namespace (core 3.4.1): 'Origin' and 1 more");
  EXPECT_CONTAINS(reported(title + title), "metadata of one name twice (core 3.4.1): 'Title'");
  EXPECT_CONTAINS(reported("<metadata name=\"vendor:x\"/>"), "a prefix that is not declared");
  EXPECT_CONTAINS(reported("", "<UNKNOWN v1=\"3\"/>"), "elements that it does not have, which are passed over: 'UNKNOWN'");
  std::string unsupported = box_among("");
  unsupported.replace(unsupported.find("<vertices>"), 10, "<vertices xmlns:v2=\"http://example.org/v2\" v2:new=\"1\">");
  EXPECT_CONTAINS(notes_of(loaded(zipped_model(unsupported))), "holds attributes of http://example.org/v2");
  std::string nameless = box_among("");
  EXPECT_CONTAINS(refusal(zipped_model(nameless.insert(nameless.find("<resources>"), "<metadata>x</metadata>"))),
                  "<metadata> without a name");
}

}  // namespace
}  // namespace lamina::test

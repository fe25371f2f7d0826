// tests/load/test_text_formats.cpp: the dialects of ASCII STL and OBJ.
#include "tests/load/files.h"

namespace lamina::test {
namespace {

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != text.npos; at += to.size()) text.replace(at, from.size(), to);
  return text;
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

const std::vector<Triangle>& box() {
  static const std::vector<Triangle> triangles = placed(loaded(write_file("clean.stl", binary_stl(unit_box()))));
  return triangles;
}

TEST(ReadAsciiStl, EveryDialectIsTheSameBox) {
  const std::string text = ascii_stl(unit_box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", text))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", ascii_stl(unit_box(), "\r\n")))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", ascii_stl(unit_box(), "\r")))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", upper(text)))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", "\xef\xbb\xbf" + text))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", replaced(text, " ", "\t")))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", replaced(text, "vertex ", "vertex +")))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", replaced(text, "10 ", "1.0e+01 ")))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", "\n\n  " + text + "; by a test\n\n"))), box());
  EXPECT_EQ(placed(loaded(write_file("a.stl", text + std::string(10, '\0')))), box()) << "padded with zeros";
  EXPECT_EQ(placed(loaded(write_file("a.stl", replaced(text, "normal 0 0 0", "normal nan -nan(ind) 1.#QNAN")))), box());
  EXPECT_EQ(placed(loaded(write_file("a.txt", text))), box());
}

TEST(ReadAsciiStl, NamesOfSolidsMeanNothing) {
  for (const char* name : {"", "facet normal", "endfacet", "vertex 1 2 3", "solid", "\xc3\xa4\xff\xfe", "a \"b\" (v2)"})
    EXPECT_EQ(placed(loaded(write_file("a.stl", ascii_stl(unit_box(), "\n", name)))), box()) << name;
}

TEST(ReadAsciiStl, SeveralSolidsAreOnePart) {
  const std::string two = ascii_stl(unit_box()) + ascii_stl(box_facets({20, 0, 0}, {25, 5, 5}));
  const Part part = loaded(write_file("two.stl", two));
  EXPECT_EQ(part.meshes.size(), 1u);
  EXPECT_EQ(part.meshes[0].triangles.size(), 24u);
  EXPECT_CONTAINS(notes_of(part), "2 solids are planned as one part");
}

TEST(ReadAsciiStl, NumbersAreReadInDoublePrecision) {
  // 2147.000001 is no float; the nearest one is 1 nm away at best and 0.1 um as a rule.
  const std::string text = replaced(ascii_stl(unit_box()), "30", "2147.000001");
  EXPECT_EQ(loaded(write_file("d.stl", text)).bounds.hi.z, 2'147'000'001);
}

TEST(ReadAsciiStl, MistakesAreNamedByLine) {
  const std::string text = ascii_stl(unit_box());
  const auto broken = [&](const std::string& from, const std::string& to, const std::string& line_end) {
    std::string changed = text;
    const std::size_t at = changed.find(from, changed.find("endfacet"));  // in the second facet
    changed.replace(at, from.size(), to);
    return refusal(write_file("bad.stl", replaced(changed, "\n", line_end)));
  };
  for (const char* line_end : {"\n", "\r\n", "\r"}) {
    EXPECT_CONTAINS(broken("vertex 0 0 0", "vertex 0,5 0 0", line_end), "line 11: '0,5' has a decimal comma");
    EXPECT_CONTAINS(broken("vertex 0 0 0", "vertex 0 0", line_end), "line 12: 'vertex' is not a number");
    EXPECT_CONTAINS(broken("vertex 0 0 0", "vertex nan 0 0", line_end), "line 11: a coordinate is not finite");
    EXPECT_CONTAINS(broken("vertex 0 0 0", "vertex 1e999 0 0", line_end), "line 11: a coordinate is not finite");
    EXPECT_CONTAINS(broken("vertex 0 0 0", "vertex 3000 0 0", line_end), "line 11: a coordinate is beyond the reach");
    EXPECT_CONTAINS(broken("outer loop", "loop", line_end), "where 'outer loop' belongs");
    EXPECT_CONTAINS(broken("endloop", "", line_end), "line 15: 'endfacet' where 'endloop' belongs");
    EXPECT_CONTAINS(broken("endloop", "vertex 1 2 3 endloop", line_end), "line 14: 'vertex' where 'endloop' belongs");
    EXPECT_CONTAINS(broken("facet normal", "facte normal", line_end), "line 10: 'outer' outside of a facet");
  }
}

TEST(ReadAsciiStl, TruncatedAtEveryLengthIsRefusedOrWhole) {
  const std::string text = ascii_stl(unit_box());
  const std::size_t last_facet = text.rfind("endfacet") + 8;
  for (std::size_t length = 0; length < text.size(); ++length) {
    const std::string path = write_file("cut.stl", text.substr(0, length));
    const Result<Part> part = load::load(path, {});
    if (length < last_facet) {
      ASSERT_FALSE(part.ok()) << length;
    } else {
      ASSERT_TRUE(part.ok()) << part.error().message;
      ASSERT_EQ(placed(*part), box());
    }
  }
}

TEST(ReadAsciiStl, DropBadLeavesTheFacetOut) {
  std::string text = ascii_stl(unit_box());
  text.replace(text.find("vertex 0 0 0"), 12, "vertex inf 0 0");
  load::LoadOptions options;
  options.drop_bad = true;
  const Part part = loaded(write_file("inf.stl", text), options);
  EXPECT_CONTAINS(notes_of(part), "1 facet with coordinates that are not finite dropped");
  EXPECT_EQ(placed(part), box());
}

TEST(ReadAsciiStl, LargeFileIsCutBetweenFacets) {
  // Several blocks of a megabyte; the solid's name is the word that blocks are cut behind.
  std::vector<FloatTriangle> facets;
  for (int i = 0; i < 3000; ++i) {
    const float x = static_cast<float>(i) / 2;
    for (const FloatTriangle& f : box_facets({x, 0, 0}, {x + 0.25f, 1, 1})) facets.push_back(f);
  }
  const std::string ascii = write_file("large_a.stl", ascii_stl(facets, "\r\n", "endfacet"));
  ASSERT_GT(std::filesystem::file_size(ascii), 3u << 20);
  const Part text = loaded(ascii), binary = loaded(write_file("large_b.stl", binary_stl(facets)));
  EXPECT_EQ(text.meshes[0].triangles, binary.meshes[0].triangles);
  EXPECT_EQ(text.meshes[0].fingerprint, binary.meshes[0].fingerprint);
  EXPECT_EQ(text.bounds.hi, binary.bounds.hi);
}

TEST(ReadAsciiStl, NutWrittenWithEightDigitsIsWithinANanometre) {
  const Part text = loaded(corpus("broken/nut_ascii_upper_crlf_tabs.stl"));
  const Part binary = loaded(corpus("broken/nut_solid_header_facet_normal.stl"));
  ASSERT_EQ(text.meshes[0].triangles.size(), binary.meshes[0].triangles.size());
  for (std::size_t i = 0; i < text.meshes[0].triangles.size(); ++i) {
    std::array<Nm, 9> one, other;
    std::memcpy(one.data(), &text.meshes[0].triangles[i], 36);
    std::memcpy(other.data(), &binary.meshes[0].triangles[i], 36);
    for (std::size_t k = 0; k < 9; ++k) ASSERT_LE(std::abs(one[k] - other[k]), 1);
  }
}

TEST(ReadObj, EveryDialectIsTheSameSurface) {
  const std::string text = box_obj();
  const std::vector<Triangle> clean = placed(loaded(write_file("box.obj", text)));
  EXPECT_EQ(clean.size(), 12u);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "\n", "\r\n")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "\n", "\r")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", "\xef\xbb\xbf# box\nmtllib a.mtl\no box\ng all\ns off\n" + text))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", "# C:\\parts\\\n" + text))), clean) << "a comment ends with its line";
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "f 1 4 3 2", "f 1 4 \\\n 3 2")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "f 1 4 3 2", "f 1 4 \\\r\n 3 2")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "f 1 4 3 2", "f 1/1 4/2 3/3 2/4 # bottom")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "f 1 4 3 2", "f 1//1 4//1 3//1 2//1")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "f 1 4 3 2", "f 1/1/1 4/2/1 3/3/1 2/4/1")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "f 1 4 3 2", "f -8 -5 -6 -7")))), clean);
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "v 0 0 0\n", "v 0 0 0 0.5 0.25 1\n")))), clean) << "colours";
  EXPECT_EQ(placed(loaded(write_file("b.obj", replaced(text, "v 0 0 0\n", "v +0 -0.0 0e0 1.0\n")))), clean) << "weight";
  EXPECT_EQ(placed(loaded(write_file("b.txt", text))), clean);
  const std::size_t faces = text.find("f 1");
  EXPECT_EQ(placed(loaded(write_file("b.obj", text.substr(faces) + text.substr(0, faces)))), clean) << "faces first";
}

TEST(ReadObj, NumbersAreReadInDoublePrecision) {
  EXPECT_EQ(loaded(write_file("d.obj", replaced(box_obj(), "30", "2147.000001"))).bounds.hi.z, 2'147'000'001);
}

TEST(ReadObj, MistakesAreNamedByLine) {
  const auto broken = [](const std::string& from, const std::string& to) {
    return refusal(write_file("bad.obj", replaced(box_obj(), from, to)));
  };
  EXPECT_CONTAINS(broken("f 1 2 6 5", "f 1 2 6 0"), "line 11: '0' is not the number of a vertex");
  EXPECT_CONTAINS(broken("f 1 2 6 5", "f 1 2 6 9"), "line 11: corner 9 of 8 vertices");
  EXPECT_CONTAINS(broken("f 1 2 6 5", "f 1 2 6 -9"), "line 11: corner -9 of 8 vertices");
  EXPECT_CONTAINS(broken("f 1 2 6 5", "f 1 2 6 99999999999999999999"), "line 11");
  EXPECT_CONTAINS(broken("f 1 2 6 5", "f 1 2 6 x"), "line 11: 'x' is not the number of a vertex");
  EXPECT_CONTAINS(broken("v 10 20 0", "v 10 20"), "line 3: a vertex has three numbers");
  EXPECT_CONTAINS(broken("v 10 20 0", "v 10 20 z"), "line 3: 'z' is not a number");
  EXPECT_CONTAINS(broken("v 10 20 0", "v 10 nan 0"), "line 3: a coordinate is not finite");
  EXPECT_CONTAINS(broken("v 10 20 0", "v 10 -3e3 0"), "line 3: a coordinate is beyond the reach");
  EXPECT_CONTAINS(refusal(write_file("none.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n")), "holds no faces");
}

TEST(ReadObj, WhatIsLeftOutIsNoted) {
  const Part part = loaded(write_file("odd.obj", box_obj() + "f 1 2\ncurv 0 1 1 2\nl 1 2\n"));
  EXPECT_CONTAINS(notes_of(part), "1 faces with less than three corners are left out");
  EXPECT_CONTAINS(notes_of(part), "1 lines are not understood and left out, the first is line 16");
}

TEST(ReadObj, DropBadLeavesOutTheFacesOfABadVertex) {
  load::LoadOptions options;
  options.drop_bad = true;
  options.repair = false;
  const Part part = loaded(write_file("nan.obj", replaced(box_obj(), "v 10 20 30", "v nan 20 30")), options);
  EXPECT_LT(part.meshes[0].triangles.size(), 12u);
  EXPECT_GE(part.meshes[0].triangles.size(), 6u);
  EXPECT_CONTAINS(notes_of(part), "not finite dropped");
}

TEST(ReadObj, TruncatedAtEveryLengthNeverCrashes) {
  const std::string text = box_obj();
  for (std::size_t length = 0; length < text.size(); ++length) {
    const Result<Part> part = load::load(write_file("cut.obj", text.substr(0, length)), {});
    if (!part) {
      ASSERT_EQ(part.error().fault, Fault::kInput) << part.error().message;
    }
  }
}

}  // namespace
}  // namespace lamina::test

// tests/load/test_unusual_files.cpp: files as other programs write them, valid or nearly so, are read or refused by their
// reason.
#include <fmt/format.h>

#include "tests/load/archives.h"
#include "tests/load/files.h"

namespace lamina::test {
namespace {

using Entries = std::vector<std::pair<std::string, std::string>>;

std::vector<Triangle> clean_box() { return placed(loaded(write_file("box.stl", binary_stl(unit_box())))); }

/// The same, with the diagonals of its faces as readers of OBJ draw them.
std::vector<Triangle> clean_obj_box() { return placed(loaded(write_file("box.obj", box_obj()))); }

std::string write_package(const std::string& resources, const std::string& build) {
  return write_file("part.3mf", zip(package(model(resources, build))));
}

TEST(UnusualObj, EveryStatementContinuesBehindABackslash) {
  const std::string text = "mtllib a.mtl\no box\ng all parts\ns off\nvt 0 0\nvn 0 0 1\nusemtl red\n" + box_obj();
  const std::vector<Triangle> clean = clean_obj_box();
  for (const char* line_end : {"\n", "\r\n", "\r"}) {
    for (const char* broken : {"\\", " \\", "\\ ", " \\ "}) {
      for (std::size_t at = 0; (at = text.find(' ', at)) != text.npos; ++at) {
        std::string changed = text;
        changed.replace(at, 1, std::string(broken).insert(std::string(broken).find('\\') + 1, line_end));
        const Part part = loaded(write_file("continued.obj", changed));
        ASSERT_EQ(placed(part), clean) << changed;
        ASSERT_TRUE(part.notes.empty()) << notes_of(part);
      }
    }
  }
  const std::string unended = text.substr(0, text.size() - 1);
  EXPECT_EQ(placed(loaded(write_file("end.obj", unended + "\\"))), clean);
  EXPECT_EQ(placed(loaded(write_file("end.obj", unended + " \\\n"))), clean);
}

TEST(UnusualObj, LinesThatABackslashTakesAreNamed) {
  load::LoadOptions options;
  options.repair = false;
  for (const char* statement :
       {"usemtl a\\", "mtllib C:\\parts\\", "g a b \\", "o a\\", "s 1\\", "l 1 2 \\", "curv 0 1 1 \\"}) {
    for (const std::string line_end : {"\n", "\r\n", "\r"}) {
      std::string text = box_obj();
      text.insert(text.find("f 3 4 8 7"), std::string(statement) + "\n");
      for (std::size_t at = 0; (at = text.find('\n', at)) != text.npos; at += line_end.size()) text.replace(at, 1, line_end);
      const Part part = loaded(write_file("taken.obj", text), options);
      EXPECT_EQ(part.meshes[0].triangles.size(), 10u) << statement;
      EXPECT_CONTAINS(notes_of(part), "line 13 begins as a vertex or a face but continues the line above");
    }
  }
  const Part two = loaded(write_file("taken.obj", box_obj() + "v 1 1 1 \\\nv 2 2 2\\\nv 3 3 3\n"), options);
  std::string continued = "g a \\\n";  // in a time that grows with its length: its square would be minutes
  for (int i = 0; i < 200'000; ++i) continued += "\\\n";
  EXPECT_EQ(loaded(write_file("continued.obj", continued + "\n" + box_obj())).meshes[0].triangles.size(), 12u);
  EXPECT_CONTAINS(notes_of(two), "line 16 begins as a vertex or a face");
  EXPECT_CONTAINS(notes_of(two), "and so do 1 more");
  // Comments end with their line.
  std::string commented = box_obj();
  for (const char* line : {"v 10 20 0\n", "f 1 4 3 2\n", "f 1 2 6 5\n"})
    commented.insert(commented.find(line) + std::string(line).size() - 1, " # C:\\parts\\");
  const Part part = loaded(write_file("comments.obj", commented + "g a # C:\\"));
  EXPECT_EQ(placed(part), clean_obj_box());
  EXPECT_TRUE(part.notes.empty()) << notes_of(part);
}

TEST(UnusualObj, VerticesThatNoFaceUsesMayBeAnything) {
  const std::vector<Triangle> clean = clean_obj_box();
  for (const char* numbers : {"nan 0 0", "0 NaN 1", "inf 1 -inf", "1e9 2 3", "0 0 -1e999", "1.#QNAN 0 0", "-nan(ind) 0 0"}) {
    const std::string vertex = fmt::format("v {}\n", numbers), last = box_obj() + vertex;
    for (int before = 0; before < 4; ++before) {
      // Numbers backwards count from the end, regardless of what precedes.
      std::string text;
      for (int i = 0; i < before; ++i) text += vertex;
      text +=
          "v 0 0 0\nv 10 0 0\nv 10 20 0\nv 0 20 0\nv 0 0 30\nv 10 0 30\nv 10 20 30\nv 0 20 30\n"
          "f -8 -5 -6 -7\nf -4 -3 -2 -1\nf -8 -7 -3 -4\nf -6 -5 -1 -2\nf -8 -4 -1 -5\nf -7 -6 -2 -3\n";
      EXPECT_EQ(placed(loaded(write_file("unused.obj", text + vertex))), clean) << text;
    }
    EXPECT_EQ(loaded(write_file("unused.obj", last)).bounds.hi.x, 10'000'000) << numbers;
    EXPECT_CONTAINS(refusal(write_file("used.obj", last + "f 1 2 9\n")), "line 15: a coordinate is ");
    load::LoadOptions options;
    options.drop_bad = true;
    EXPECT_EQ(placed(loaded(write_file("unused.obj", last), options)), clean);
  }
}

TEST(Unusual3mf, ItemsThatAreNotPrintableAreLeftOut) {
  const auto build = [](const char* value, int id) {
    return fmt::format("<item objectid=\"{}\" printable=\"{}\"/>", id, value);
  };
  const std::string objects = box_object(1, 10, 20, 30) + box_object(2, 5, 5, 5) + components(3, component(2) + component(2));
  for (const char* no : {"0", "false", " 0 "}) {
    for (const int id : {2, 3}) {
      const Part part = loaded(write_package(objects, build(no, id) + item(1) + build(no, id)));
      EXPECT_EQ(placed(part), clean_box()) << no;
      EXPECT_CONTAINS(notes_of(part), "2 build items are not planned: marked as not printable");
    }
    EXPECT_CONTAINS(refusal(write_package(objects, build(no, 1))),
                    "nothing to print (1 build item is not planned: marked as not printable)");
  }
  for (const char* yes : {"1", "true"}) EXPECT_EQ(placed(loaded(write_package(objects, build(yes, 1)))), clean_box());
}

TEST(Unusual3mf, SurfacesAloneAreRefusedAsSuch) {
  const std::string surface = box_object(1, 10, 20, 30, "type=\"surface\"");
  for (const std::string& build :
       {surface, surface + box_object(2, 1, 1, 1, "type=\"support\""), surface + components(2, component(1))})
    EXPECT_CONTAINS(refusal(write_package(build, build == surface ? item(1) : item(1) + item(2))),
                    "type \"surface\", which is no solid");
}

TEST(Unusual3mf, ThumbnailsAndAttachmentsDoNotMatter) {
  const Entries plain = package(model(box_object(1, 10, 20, 30), item(1)));
  Entries entries = plain;
  const std::string end = "</Relationships>";
  entries[1].second.insert(
      entries[1].second.find(end),
      "<Relationship Target=\"/Metadata/no.png\" Id=\"r9\" Type=\"http://schemas.openxmlformats.org/package/"
      "2006/relationships/metadata/thumbnail\"/>");
  const Part part = loaded(write_file("no_thumbnail.3mf", zip(entries)));
  EXPECT_EQ(placed(part), clean_box());
  EXPECT_CONTAINS(notes_of(part), "a thumbnail that is named and not contained (core 2.1.3): '/Metadata/no.png'");
  load::LoadOptions options;
  options.expanded_limit = 10'000;
  for (const char* name : {"Metadata/plate_1.png", "Attachments/log.txt", "3D/Textures/wood.png", "other/_rels/x.rels"}) {
    entries = plain;
    entries.push_back({name, std::string(100'000, '\0')});
    EXPECT_EQ(placed(loaded(write_file("large.3mf", zip(entries)), options)), clean_box()) << name;
    std::rotate(entries.begin(), entries.end() - 1, entries.end());
    EXPECT_EQ(placed(loaded(write_file("large.3mf", zip(entries)), options)), clean_box()) << name;
  }
  for (std::size_t needed : {1u, 2u}) {
    entries = plain;
    entries[needed].second += std::string(100'000, ' ');
    EXPECT_CONTAINS(refusal(write_file("large.3mf", zip(entries)), options), "expands to more than the limit of 10000 bytes");
  }
  entries.push_back({"bomb.txt", std::string(80u << 20, ' ')});
  entries[2] = plain[2];
  EXPECT_EQ(placed(loaded(write_file("bomb.3mf", zip(entries)))), clean_box());
}

TEST(UnusualStl, NamesOfSolidsMayHaveAnyByte) {
  for (const std::string& name : {std::string(70, '\0'), "part" + std::string(72, '\0'), std::string("a\x01\x1b[0m\x7f b"),
                                  std::string("\0facet\0", 7), std::string(3000, '\0')}) {
    for (const char* line_end : {"\n", "\r\n", "\r", " "}) {
      const Part part = loaded(write_file("name.stl", ascii_stl(unit_box(), line_end, name)));
      EXPECT_EQ(placed(part), clean_box()) << name.size() << ' ' << int{line_end[0]};
    }
  }
}

TEST(UnusualStl, BlankLinesInFrontDoNotMatter) {
  const std::vector<Triangle> clean = clean_box();
  for (const std::size_t count : {1u, 2u, 4090u, 4094u, 4095u, 4096u, 4097u, 5000u, 8191u, 8192u, 300'000u}) {
    for (const char* blank : {"\n", "\r\n", " ", "\t\n"}) {
      std::string front;
      while (front.size() < count) front += blank;
      EXPECT_EQ(placed(loaded(write_file("late.stl", front + ascii_stl(unit_box())))), clean) << count;
      EXPECT_EQ(placed(loaded(write_file("late.txt", front + box_obj()))), clean_obj_box()) << count;
      EXPECT_CONTAINS(refusal(write_file("late.stl", front + "ISO-10303-21;\nHEADER;\n")), "is STEP");
      EXPECT_CONTAINS(refusal(write_file("blank.stl", front)), "is text, but neither STL nor OBJ");
    }
  }
}

TEST(UnusualStl, BigEndianIsNamed) {
  for (const std::size_t boxes : {1u, 2u, 30u, 255u}) {
    std::vector<FloatTriangle> facets;
    for (std::size_t i = 0; i < boxes; ++i)
      for (const FloatTriangle& f : box_facets({3.0f * static_cast<float>(i), 0, 0}, {3.0f * static_cast<float>(i) + 2, 2, 2}))
        facets.push_back(f);
    std::string bytes = binary_stl(facets);
    std::reverse(bytes.begin() + 80, bytes.begin() + 84);
    for (std::size_t facet = 84; facet < bytes.size(); facet += 50)
      for (std::size_t at = facet; at < facet + 48; at += 4)
        std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.begin() + static_cast<std::ptrdiff_t>(at + 4));
    for (const char* name : {"big.stl", "big.bin", "big"})
      EXPECT_CONTAINS(refusal(write_file(name, bytes)), "big-endian byte order") << boxes;
  }
}

TEST(UnusualNumbers, DecimalCommasAreNamed) {
  const auto with_comma = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const char* const expected = "' has a decimal comma; export it again with decimal points";
  for (const char* number : {"10,5", "-0,25", "1,5e3", "+7,0", "0,1E-2"}) {
    const std::string stl = with_comma(ascii_stl(unit_box()), "vertex 0 0 0", fmt::format("vertex {} 0 0", number));
    EXPECT_CONTAINS(refusal(write_file("comma.stl", stl)), fmt::format("'{}{}", number, expected));
    EXPECT_CONTAINS(refusal(write_file("comma.obj", with_comma(box_obj(), "v 10", fmt::format("v {}", number)))), expected);
    EXPECT_CONTAINS(
        refusal(write_package(with_comma(box_object(1, 1, 1, 1), "x=\"1\"", fmt::format("x=\"{}\"", number)), item(1))),
        expected);
  }
  for (const char* number : {"1,", ",", "1,2,3", "1,x", "a,5", "1.000,5"})
    EXPECT_CONTAINS(refusal(write_file("comma.obj", with_comma(box_obj(), "v 10", fmt::format("v {}", number)))),
                    "' is not a number");
}

}  // namespace
}  // namespace lamina::test

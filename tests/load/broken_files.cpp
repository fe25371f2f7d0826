// tests/load/broken_files.cpp: the files of broken_files.h, by name.
#include "tests/load/broken_files.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace lamina::test {
namespace {

const char* const kNut = "parameter_quality_nut.stl";
const char* const kCrown = "dental_crown.stl";
const char* const kArtifact = "nist_am_test_artifact_v3b.stl";

struct Solid {
  std::string name;
  Facets facets;
};

/// Solids that come with every way of breaking.
const std::vector<Solid>& solids() {
  static const std::vector<Solid> all{
      {"nut", corpus_part(kNut)}, {"crown", corpus_part(kCrown)},     {"artifact", corpus_part(kArtifact)},
      {"ball", ball(8, 16)},      {"ring", ring(10, 3, 16)},          {"cup", cup(10, 0.8f, 15, 32)},
      {"stairs", stairs(4)},      {"box", subdivided(unit_box(), 1)},
  };
  return all;
}

/// Breaks a solid by chance, the same for the same name.
struct Way {
  std::string name;
  Ends ends;
  std::function<Facets(const Facets&, Random&)> break_it;
};

const std::vector<Way>& paths() {
  const auto jitter = [](double um) { return [um](const Facets& f, Random& r) { return jittered(f, r, um); }; };
  const auto missing = [](double share) { return [share](const Facets& f, Random& r) { return without(f, r, share); }; };
  static const std::vector<Way> all{
      {"jitter 1 um", Ends::kSolid, jitter(1)},
      {"jitter 4 um", Ends::kSolid, jitter(4)},
      {"jitter 20 um", Ends::kSolid, jitter(20)},
      {"1 % missing", Ends::kReportedOr, missing(0.01)},
      {"10 % missing", Ends::kReportedOr, missing(0.1)},
      {"a hole of 3 mm", Ends::kReportedOr, [](const Facets& f, Random& r) { return with_hole(f, r, 3); }},
      {"20 % flipped", Ends::kSolid, [](const Facets& f, Random& r) { return flipped(f, r, 0.2); }},
      {"15 % twice", Ends::kSolid, [](const Facets& f, Random& r) { return duplicated(f, r, 0.15); }},
      {"T-junctions", Ends::kSolid, [](const Facets& f, Random& r) { return split_sides(f, r, 0.1); }},
      {"needles", Ends::kSolid, [](const Facets& f, Random& r) { return with_needles(f, r, 0.1); }},
      {"loose sheets", Ends::kSolid, [](const Facets& f, Random& r) { return with_sheets(f, r, 5); }},
  };
  return all;
}

std::string cut(const std::string& bytes, std::size_t from_end) { return bytes.substr(0, bytes.size() - from_end); }

void add_counts(std::vector<BrokenFile>& files) {
  const Facets nut = corpus_part(kNut), box = unit_box();
  const auto count = static_cast<std::int64_t>(nut.size());
  Random random(7);
  const std::string plain = binary_stl(nut);
  files.push_back({"count too low by one.stl", binary_stl(nut, "", count - 1), nut, Ends::kSolid});
  files.push_back({"count half.stl", binary_stl(nut, "", count / 2), nut, Ends::kSolid});
  files.push_back({"count 1.stl", binary_stl(nut, "", 1), nut, Ends::kSolid});
  files.push_back({"count 0.stl", binary_stl(nut, "", 0), nut, Ends::kSolid});
  files.push_back({"count too high.stl", binary_stl(nut, "", count + 1000), nut, Ends::kSolid});
  files.push_back({"count all ones.stl", binary_stl(nut, "", 0xffffffff), nut, Ends::kSolid});
  files.push_back({"count of the first of two bodies.stl", binary_stl(joined(box, moved(nut, 40, 0, 0)), "", 12),
                   joined(box, moved(nut, 40, 0, 0)), Ends::kSolid});
  files.push_back({"count half, a facet missing.stl", binary_stl(Facets(nut.begin() + 1, nut.end()), "", count / 2), nut,
                   Ends::kReportedOr});
  files.push_back({"count half, jitter 4 um.stl", binary_stl(jittered(nut, random, 4), "", count / 2), nut, Ends::kSolid});
  files.push_back({"zeros behind.stl", plain + std::string(50000, '\0'), nut, Ends::kSolid});
  files.push_back({"rubbish behind.stl", plain + std::string(5000, '\x41'), nut, Ends::kSolid});
  files.push_back({"seven bytes behind.stl", plain + "1234567", nut, Ends::kSolid});
  files.push_back({"cut in a facet.stl", cut(plain, 5017), nut, Ends::kRefused});
  files.push_back({"cut between facets.stl", cut(plain, 5000), nut, Ends::kRefused});
  files.push_back({"cut to the header.stl", plain.substr(0, 84), {}, Ends::kRefused});
  files.push_back({"cut in the header.stl", plain.substr(0, 40), {}, Ends::kRefused});
}

void add_texts(std::vector<BrokenFile>& files) {
  const Facets& box = unit_box();
  const std::string plain = ascii_stl(box);
  const auto add = [&](const char* name, const std::string& bytes, Ends ends = Ends::kSolid) {
    files.push_back({name, bytes, ends == Ends::kRefused ? Facets() : box, ends});
  };
  add("one line.stl", one_line_ascii(box));
  add("one line with a long name.stl", replaced(one_line_ascii(box), "solid x", "solid facet of a solid"));
  add("DOS end of file.stl", plain + "\x1a");
  add("DOS end of file, CRLF.stl", ascii_stl(box, "\r\n") + std::string(60, '\x1a'));
  add("DOS end of file.obj", box_obj() + "\x1a");
  add("CR.stl", ascii_stl(box, "\r"));
  add("colour lines.stl", coloured_ascii(box));
  add("no name, no end.stl", replaced(replaced(plain, "solid made for a test", "solid"), "endsolid", ""));
  add("lines of remarks.stl", replaced(plain, "    endloop", "    ; a remark\n    endloop"), Ends::kRefused);
  add("decimal commas.stl", replaced(plain, "10", "10,5"), Ends::kRefused);
  add("two corners.stl", replaced(plain, "      vertex 10 0 0\n", ""), Ends::kRefused);
  add("UTF-8 mark.stl", "\xef\xbb\xbf" + plain);
  add("quads.obj", box_obj());
  add("face 9 of 8.obj", box_obj() + "f 1 2 9\n", Ends::kRefused);
  add("NUL behind.stl", plain + std::string(512, '\0'));
  add("cut in the text.stl", plain.substr(0, plain.size() / 2), Ends::kRefused);
}

void add_unsupported(std::vector<BrokenFile>& files) {
  const auto add = [&](const char* name, const std::string& bytes) { files.push_back({name, bytes, {}, Ends::kRefused}); };
  add("step.stl", "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n");
  add("iges.stl", std::string(72, ' ') + "S      1\n");
  add("ply.stl", "ply\nformat ascii 1.0\nelement vertex 8\n");
  add("amf.stl", "<?xml version=\"1.0\"?>\n<amf unit=\"millimeter\">\n");
  add("off.stl", "OFF\n8 12 0\n0 0 0\n");
  add("x3d.stl", "<?xml version=\"1.0\"?>\n<X3D version=\"3.0\">\n");
  add("vrml.stl", "#VRML V2.0 utf8\nShape {}\n");
  add("utf16.stl", utf16(ascii_stl(unit_box())));
  add("html.stl", "<!DOCTYPE html>\n<html><body>Sign in to download</body></html>\n");
  add("pdf.stl", "%PDF-1.7\n");
  add("gcode.stl", "; generated\nG28\nG1 X10 Y10 E1\n");
  add("json.3mf", "{\"error\": \"not found\"}\n");
  add("words.stl", "just some words\n");
  add("empty.obj", "");
}

void add_shells(std::vector<BrokenFile>& files) {
  const Facets box = unit_box(), fine = ball(8, 16);
  const auto add = [&](const char* name, const Facets& facets, const Facets& sound, Ends ends) {
    files.push_back({name, binary_stl(facets), sound, ends});
  };
  Random random(11);
  add("inverted twins.stl", joined(box, inside_out(box)), {}, Ends::kRefused);
  add("inverted twins, jitter 4 um.stl", jittered(joined(fine, inside_out(fine)), random, 4), fine, Ends::kReportedOr);
  add("a body next to inverted twins.stl", joined(moved(fine, 50, 0, 0), joined(box, inside_out(box))), moved(fine, 50, 0, 0),
      Ends::kNamed);
  add("inside out.stl", inside_out(fine), fine, Ends::kSolid);
  add("inside out, jitter 20 um.stl", jittered(inside_out(fine), random, 20), fine, Ends::kSolid);
  add("two, one inside out.stl", joined(box, moved(inside_out(fine), 40, 0, 0)), joined(box, moved(fine, 40, 0, 0)),
      Ends::kSolid);
  add("a hollow.stl", joined(ball(9, 16), inside_out(fine)), joined(ball(9, 16), inside_out(fine)), Ends::kSolid);
  add("a hollow, jitter 4 um.stl", jittered(joined(ball(9, 16), inside_out(fine)), random, 4),
      joined(ball(9, 16), inside_out(fine)), Ends::kSolid);
  add("three within each other, the middle inside out.stl", joined(joined(ball(9, 16), inside_out(fine)), ball(4, 16)),
      joined(joined(ball(9, 16), inside_out(fine)), ball(4, 16)), Ends::kSolid);
  add("twins.stl", joined(box, box), box, Ends::kSolid);
  add("twins, jitter 4 um.stl", jittered(joined(fine, fine), random, 4), fine, Ends::kReportedOr);
  add("touching boxes.stl", joined(box, moved(box, 10, 0, 0)), joined(box, moved(box, 10, 0, 0)), Ends::kSolid);
  add("touching boxes, jitter 4 um.stl", jittered(subdivided(joined(box, moved(box, 10, 0, 0)), 1), random, 4),
      joined(box, moved(box, 10, 0, 0)), Ends::kSolid);
  add("boxes 30 um apart, jitter 4 um.stl", jittered(subdivided(joined(box, moved(box, 10.03f, 0, 0)), 2), random, 4),
      joined(box, moved(box, 10.03f, 0, 0)), Ends::kSolid);
  add("wall of 50 um, jitter 4 um.stl", jittered(cup(10, 0.05f, 15, 32), random, 4), cup(10, 0.05f, 15, 32), Ends::kReportedOr);
  add("wall of 50 um.stl", cup(10, 0.05f, 15, 32), cup(10, 0.05f, 15, 32), Ends::kSolid);
  add("zero thickness.stl", scaled(joined(Facets{{0, 0, 0, 9, 0, 4, 0, 9, 2}}, Facets{{0, 0, 0, 0, 9, 2, 9, 0, 4}}), 1), {},
      Ends::kRefused);
  add("a sheet.stl", Facets{{0, 0, 0, 9, 0, 4, 0, 9, 2}}, {}, Ends::kRefused);
  add("a sheet of many facets.stl", subdivided(Facets{{0, 0, 0, 9, 0, 4, 0, 9, 2}}, 3), {}, Ends::kRefused);
  add("five faces of a box.stl", Facets(box.begin(), box.begin() + 10), box, Ends::kReportedOr);
  add("two faces of a box.stl", Facets(box.begin(), box.begin() + 4), {}, Ends::kRefused);
}

void add_gaps(std::vector<BrokenFile>& files) {
  const auto add = [&](const std::string& name, const Facets& facets, const Facets& sound, Ends ends) {
    files.push_back({name, binary_stl(facets), sound, ends});
  };
  const Facets box = subdivided(unit_box(), 1), fine = ball(8, 16), nut = corpus_part(kNut);
  for (const int um : {10, 40, 100, 300}) {
    // Facets moved outward are those of a larger solid.
    const float d = static_cast<float>(um) / 1000;
    add(fmt::format("box, facets {} um apart.stl", um), apart(box, um), box_facets({-d, -d, -d}, {10 + d, 20 + d, 30 + d}),
        Ends::kReportedOr);
    add(fmt::format("ball, facets {} um apart.stl", um), apart(fine, um), ball(8 + d, 16), Ends::kSolid);
  }
  Random random(13);
  add("nut, jitter 80 um.stl", jittered(nut, random, 80), nut, Ends::kReportedOr);
  add("nut, jitter 300 um.stl", jittered(nut, random, 300), nut, Ends::kReportedOr);
  add("nut, jitter 20 um, 10 % flipped.stl", flipped(jittered(nut, random, 20), random, 0.1), nut, Ends::kSolid);
  add("nut, jitter 20 um, 1 % missing.stl", without(jittered(nut, random, 20), random, 0.01), nut, Ends::kReportedOr);
  add("nut, jitter 20 um, T-junctions.stl", jittered(split_sides(nut, random, 0.1), random, 20), nut, Ends::kReportedOr);
  add("nut, 15 % twice, jitter 4 um.stl", jittered(duplicated(nut, random, 0.15), random, 4), nut, Ends::kReportedOr);
  add("ball of 1 mm, jitter 1 um.stl", jittered(scaled(fine, 1.f / 16), random, 1), scaled(fine, 1.f / 16), Ends::kSolid);
  add("box far away.stl", moved(box, 1500, 1500, 0), moved(box, 1500, 1500, 0), Ends::kSolid);
  add("ball far away.stl", moved(fine, 2000, 2000, 0), moved(fine, 2000, 2000, 0), Ends::kSolid);
  add("box beyond reach.stl", moved(box, 1e6f, 0, 0), {}, Ends::kRefused);
  add("slivers.stl", with_slivers(nut, random, 0.3), nut, Ends::kSolid);
  add("nut, 30 % missing.stl", without(nut, random, 0.3), nut, Ends::kReportedOr);
  add("ball, 60 % missing.stl", without(fine, random, 0.6), fine, Ends::kReportedOr);
  const Facets plate = scaled(box_facets({0, 0, 0}, {200, 200, 1}), 0.5f);
  add("plate of 0.5 mm, jitter 4 um.stl", jittered(plate, random, 4), plate, Ends::kSolid);
  add("plate of 0.5 mm, jitter 80 um.stl", jittered(plate, random, 80), plate, Ends::kReportedOr);
}

}  // namespace

std::string one_line_ascii(const Facets& facets) {
  std::string text = ascii_stl(facets, " ", "x");
  return text;
}

std::string coloured_ascii(const Facets& facets) {
  std::string text = replaced(ascii_stl(facets), "    endloop", "    endloop\n    color 1 0 0");
  return replaced(text, "  facet normal 0 0 0\n", "  color 0.5 0.5 0.5\n  facet normal 0 0 0\n");
}

std::string obj_text(const Facets& facets) {
  std::string text = "# made for a test\n";
  for (const FloatTriangle& f : facets) {
    for (std::size_t k = 0; k < 9; k += 3) text += fmt::format("v {} {} {}\n", f[k], f[k + 1], f[k + 2]);
    text += "f -3 -2 -1\n";
  }
  return text;
}

std::string utf16(const std::string& text) {
  std::string wide = "\xff\xfe";
  for (const char c : text) wide += {c, '\0'};
  return wide;
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = text.find(what); at != text.npos; at = text.find(what, at + with.size()))
    text.replace(at, what.size(), with);
  return text;
}

std::vector<BrokenFile> broken_files() {
  std::vector<BrokenFile> files;
  std::uint32_t seed = 1;
  for (const Solid& solid : solids()) {
    for (const Way& way : paths()) {
      Random random(++seed);
      files.push_back(
          {solid.name + ", " + way.name + ".stl", binary_stl(way.break_it(solid.facets, random)), solid.facets, way.ends});
    }
  }
  add_counts(files);
  add_texts(files);
  add_unsupported(files);
  add_shells(files);
  add_gaps(files);
  return files;
}

BrokenFile random_broken_file(std::uint32_t seed) {
  Random random(seed);
  static const std::vector<std::pair<std::string, std::function<Facets(Facets, Random&)>>> kBreaks{
      {"jitter", [](Facets f, Random& r) { return jittered(std::move(f), r, 0.2 * std::pow(1.05, r() % 128)); }},
      {"missing", [](const Facets& f, Random& r) { return without(f, r, 0.002 * static_cast<double>(1 + r() % 50)); }},
      {"hole", [](const Facets& f, Random& r) { return with_hole(f, r, 0.5f * static_cast<float>(1 + r() % 8)); }},
      {"flipped", [](const Facets& f, Random& r) { return flipped(f, r, 0.01 * static_cast<double>(1 + r() % 40)); }},
      {"twice", [](const Facets& f, Random& r) { return duplicated(f, r, 0.01 * static_cast<double>(1 + r() % 40)); }},
      {"T-junctions", [](const Facets& f, Random& r) { return split_sides(f, r, 0.01 * static_cast<double>(1 + r() % 40)); }},
      {"needles", [](const Facets& f, Random& r) { return with_needles(f, r, 0.01 * static_cast<double>(1 + r() % 40)); }},
      {"slivers", [](const Facets& f, Random& r) { return with_slivers(f, r, 0.01 * static_cast<double>(1 + r() % 40)); }},
      {"sheets", [](const Facets& f, Random& r) { return with_sheets(f, r, static_cast<int>(1 + r() % 9)); }},
      {"inside out", [](const Facets& f, Random&) { return inside_out(f); }},
      {"shuffled", [](Facets f, Random& r) {
         std::shuffle(f.begin(), f.end(), r);
         return f;
       }}};
  const Solid& solid = solids()[random() % solids().size()];
  std::string name = fmt::format("{}: {}", seed, solid.name);
  Facets sound = solid.facets;
  if (random() % 4 == 0) {
    const float factor = 0.1f * static_cast<float>(1 + random() % 30);
    sound = scaled(sound, factor);
    name += fmt::format(" x {:.1f}", factor);
  }
  Facets facets = sound;
  for (auto left = 1 + random() % 3; left > 0; --left) {
    const auto& [what, break_it] = kBreaks[random() % kBreaks.size()];
    Facets broken = break_it(facets, random);
    if (broken.empty()) continue;  // a hole as large as the solid
    facets = std::move(broken);
    name += ", " + what;
  }
  const auto form = random() % 6;
  const std::string bytes = form == 0   ? ascii_stl(facets)
                            : form == 1 ? obj_text(facets)
                            : form == 2 ? one_line_ascii(facets)
                            : form == 3 ? binary_stl(facets, "", static_cast<std::int64_t>(random() % facets.size()))
                                        : binary_stl(facets);
  return {name + (form == 1 ? ".obj" : ".stl"), bytes, sound, Ends::kReportedOr};
}

}  // namespace lamina::test

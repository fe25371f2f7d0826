// STL, OBJ and gzip of them: load().
#include <zlib.h>

#include <cstring>

#include "stages/formats/stl/mesh_stl.h"
#include "stages/load/load.h"
#include "tests/fuzz/laws.h"
#include "tests/load/archives.h"

namespace lamina::fuzz {
namespace {

/// Options follow from the bytes: most inputs are read as a job would.
load::LoadOptions options_for(std::string_view bytes) {
  load::LoadOptions options;
  options.triangle_limit = 2000;
  options.expanded_limit = 1 << 18;
  Dice dice(bytes);
  options.repair = dice.below(8) != 0;
  options.drop_bad = dice.below(4) == 0;
  if (dice.below(4) == 0) options.unit_mm = 25.4;
  if (dice.below(4) == 0) options.transform = load::make_transform({-1, 2, 0.5}, {90, 10, -30}, {1, 1.02, 1});
  return options;
}

bool load_file(MemoryFile& file, std::string_view bytes) {
  const load::LoadOptions options = options_for(bytes);
  const Result<Part> part = load::load(file.hold(bytes), options);
  if (!part) return check_error(part.error()), false;
  check_part(*part, options.triangle_limit, options.repair);
  return true;
}

bool load_stl(std::string_view bytes) {
  static MemoryFile file("part.stl");
  return load_file(file, bytes);
}
bool load_obj(std::string_view bytes) {
  static MemoryFile file("part.obj");
  return load_file(file, bytes);
}
bool load_gzip(std::string_view bytes) {
  static MemoryFile file("part.stl.gz");
  return load_file(file, bytes);
}

constexpr int kBlock[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                               {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
std::string corner(int i) { return std::string(i & 1 ? "10" : "0") + (i & 2 ? " 20" : " 0") + (i & 4 ? " 5.5" : " 0"); }

std::vector<std::string> binary_seeds() {
  const std::string block = formats::stl::block({10, 20, 5}), other = formats::stl::block({3, 3, 30});
  std::string open = block.substr(0, 84 + 50 * 11), two = block + other.substr(84);
  open[80] = 11;
  two[80] = 24;
  return {block, open, two};
}

std::vector<std::string> ascii_seeds() {
  std::string text = "solid block\n";
  for (const auto& t : kBlock) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (const int i : t) text += "  vertex " + corner(i) + "\n";
    text += " endloop\nendfacet\n";
  }
  return {text + "endsolid block\n"};
}

std::vector<std::string> obj_seeds() {
  std::string text = "# block\no block\n", quads = text;
  for (int i = 0; i < 8; ++i) text += "v " + corner(i) + "\n";
  quads = text + "f 1 3 4 2\nf 5 6 8 7\nf 1/1/1 2/2/1 6/3/1 5/4/1\nf -6 -2 -1 -5\nf 1//1 5//1 7//1 3//1\nf 2 4 8 6\n";
  for (const auto& t : kBlock) {
    text += "f";
    for (const int i : t) text += " " + std::to_string(i + 1);
    text += "\n";
  }
  return {text, quads};
}

std::vector<std::string> gzip_seeds() { return {test::gzip(binary_seeds()[0]), test::gzip(ascii_seeds()[0])}; }

/// Whole facets and their count, corners that meet, and coordinates that people use.
std::size_t mutate_binary(std::uint8_t* bytes, std::size_t size, std::size_t maximum, std::uint32_t seed) {
  const std::size_t facets = size < 134 ? 0 : (std::min(size, maximum) - 84) / 50;
  if (facets == 0) return size;
  Dice dice({reinterpret_cast<const char*>(bytes), size});
  dice.below(seed | 1);
  const auto at = [&](std::size_t facet, std::size_t corner) { return bytes + 84 + 50 * facet + 12 + 12 * corner; };
  for (std::uint32_t times = dice.below(4); times-- > 0;) {
    const std::size_t f = dice.below(static_cast<std::uint32_t>(facets)), g = dice.below(static_cast<std::uint32_t>(facets));
    const std::uint32_t i = dice.below(3), j = dice.below(3);
    constexpr float kNumbers[] = {0, 1, -1, 10, 0.001f, 1e-6f, 2147, -2147.48f, 1e30f, 5, 20, 0.1f};
    const float number = kNumbers[dice.below(12)];
    switch (dice.below(5)) {
      case 0: std::memmove(at(f, i), at(g, j), 12); break;                           // two corners meet
      case 1: std::memmove(at(f, 0) - 12, at(g, 0) - 12, 50); break;                 // a facet twice
      case 2: std::swap_ranges(at(f, i), at(f, i) + 12, at(f, (i + 1) % 3)); break;  // a facet inside out
      case 3: std::memcpy(at(f, i) + 4 * j, &number, 4); break;
      default: std::swap_ranges(at(f, i), at(f, i) + 12, at(g, j)); break;
    }
  }
  for (int k = 0; k < 4; ++k) bytes[80 + k] = static_cast<std::uint8_t>(facets >> (8 * k));
  return 84 + 50 * facets;
}

constexpr std::string_view kMeshSources = "stages/load stages/data";
const Registered kBinary({"stl_binary", load_stl, binary_seeds, kMeshSources, ".stl", {}, 1700, mutate_binary});
const Registered kAscii({"stl_ascii", load_stl, ascii_seeds, kMeshSources, ".stl", "stl.dict", 4000});
const Registered kObj({"obj", load_obj, obj_seeds, kMeshSources, ".obj", "obj.dict", 2000});
const Registered kGzip({"gzip", load_gzip, gzip_seeds, kMeshSources, ".gz", {}, 2000});

}  // namespace
}  // namespace lamina::fuzz

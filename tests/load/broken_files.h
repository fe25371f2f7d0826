// tests/load/broken_files.h: sound solids, ways to break them, and what was broken, made again for each test.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "tests/load/files.h"

namespace lamina::test {

using Facets = std::vector<FloatTriangle>;

// --- sound solids, closed and outward, in mm

Facets ball(float radius, int steps);
Facets ring(float large, float small, int steps);                // a torus
Facets tube(float outer, float inner, float height, int steps);  // open at both ends, with a wall
Facets cup(float outer, float wall, float height, int steps);    // a tube with a floor
Facets stairs(int steps);                                        // a prism over a polygon with inner corners
Facets subdivided(const Facets& facets, int times);              // each facet in four
Facets corpus_part(const std::string& file);                     // its facets, as floats
Facets joined(Facets one, const Facets& other);                  // two lists as one
Facets moved(Facets facets, float x, float y, float z);
Facets scaled(Facets facets, float factor);

// --- ways to break them; the same for the same seed

using Random = std::mt19937;
Facets jittered(Facets facets, Random& random, double um);            // every corner of every facet by up to um along each axis
Facets without(const Facets& facets, Random& random, double share);   // some facets missing
Facets with_hole(const Facets& facets, Random& random, float width);  // all facets near a corner missing
Facets flipped(Facets facets, Random& random, double share);
Facets duplicated(Facets facets, Random& random, double share);
Facets inside_out(Facets facets);
Facets split_sides(const Facets& facets, Random& random, double share);   // on one side only: T-junctions
Facets with_needles(const Facets& facets, Random& random, double share);  // a facet cut into two, one of them a needle
Facets with_slivers(Facets facets, Random& random, double share);         // facets without area, along sides
Facets with_sheets(Facets facets, Random& random, int count);             // loose facets about the solid
Facets apart(Facets facets, double um);                                   // each facet moved along its normal

// --- ways to write them

std::string one_line_ascii(const Facets& facets);
std::string coloured_ascii(const Facets& facets);  // with words that the format does not have
std::string obj_text(const Facets& facets);
std::string utf16(const std::string& text);
std::string replaced(std::string text, const std::string& what, const std::string& with);

/// Volume by rays: the lengths within the solid (winding number not 0) of rows along x through `rows` squared points of a box,
/// spread so that walls along the axes count by their thickness, not by how many rows they happen to meet. Nothing of the
/// loader's own arithmetic is in it.
double volume_by_rays(const std::vector<const Buffer<Triangle>*>& meshes, const Box& box, int rows);

// --- the files

enum class Ends {
  kSolid,       // planned, within 3 % of the volume
  kReportedOr,  // that, or the share on caps is told and a note says so, or it is refused
  kNamed,       // planned, and a note says what is lost
  kRefused,     // exit 3
};

struct BrokenFile {
  std::string name;  // with its ending
  std::string bytes;
  Facets sound;  // the solid that is meant; empty where none is
  Ends ends;
};

/// At least a hundred, always the same.
std::vector<BrokenFile> broken_files();

/// One of endlessly many: a solid, up to three ways to break it, and a way to write it, all by chance.
BrokenFile random_broken_file(std::uint32_t seed);

}  // namespace lamina::test

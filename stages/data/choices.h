// stages/data/choices.h: the ways of working among which a job chooses, by name; the stages that know them say more.
#pragma once

#include <cstdint>

namespace lamina {

/// Bitmaps of a powder printer, contours of layers, or the moves of an extrusion printer.
enum class Product { kImages, kContours, kMoves };

/// The bit of a product in a set of them.
constexpr unsigned bit(Product product) { return 1u << static_cast<unsigned>(product); }

/// What survives a power cut: nothing for certain, a job that has ended, or all but the layers in flight of one that runs.
enum class Sync : std::uint8_t { kOff, kJob, kLayer };

/// The files of a job: in a directory, or all in one ZIP file.
enum class Container : std::uint8_t { kNone, kZip, kTiff };

/// The widest instructions that kernels use; auto: the processor's. The bytes are the same.
enum class Isa : std::uint8_t { kAuto, kPlain, kAvx2, kAvx512 };

/// Applied to the winding number of all facets together about a point.
enum class FillRule : std::uint8_t {
  kNonzero,   // not zero: the union of overlapping shells; a shell turned inside out is still solid
  kPositive,  // above zero: a shell turned inside out is empty
  kEvenOdd    // odd: what lies in two shells is a hole
};

constexpr bool is_solid(FillRule rule, std::int32_t winding) {
  switch (rule) {
    case FillRule::kPositive: return winding > 0;
    case FillRule::kEvenOdd: return (winding & 1) != 0;
    case FillRule::kNonzero: break;
  }
  return winding != 0;
}

}  // namespace lamina

namespace lamina::raster {

/// Of beads, where they end and where thick becomes thin.
enum class BeadEnds : std::uint8_t { kRound, kSquare };

}  // namespace lamina::raster

// pipeline/job/product.h: what a job can be planned for.
#pragma once

namespace lamina::pipeline {

/// Bitmaps of a powder printer, contours of layers, or the moves of an extrusion printer.
enum class Product { kImages, kContours, kMoves };

/// The bit of a product in a set of them.
constexpr unsigned bit(Product product) { return 1u << static_cast<unsigned>(product); }

}  // namespace lamina::pipeline

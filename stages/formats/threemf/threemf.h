// stages/formats/threemf/threemf.h: meshes, and slices by the slice extension, as 3MF files.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"
#include "stages/formats/slice_format.h"
#include "stages/formats/zip/zip.h"
#include "stages/support/io/file.h"

namespace lamina::formats {

/// Checks the date of the packages, before anything is made for one. errors  kUsage: SOURCE_DATE_EPOCH is no number
Status check_3mf_date();

/// An object of the file.
struct Mesh3mfObject {
  std::string name;                     // shown by other programs; "" for none
  std::span<const Triangle> triangles;  // nm, corners counter-clockwise viewed from outside; borrowed
};

struct Mesh3mfCounts {
  std::uint64_t vertices = 0, triangles = 0;  // of all objects, once each
  std::uint64_t degenerate = 0;               // triangles of two equal corners: 3MF forbids them, and no solid needs them
};

/// Writes each object once and a build item for each instance, which is moved by its offset. Numbers are mm with as many
/// decimals as they need, at most 6, exact to the nanometre. Equal corners are one vertex, numbered in the order of their first
/// triangle, so a closed mesh is closed to every reader. The same meshes give the same bytes with any threads.
///
/// file       open, at its beginning (an open File of this folder's file.h); the caller finishes it
/// instances  Instance::mesh is an index into `objects`; at least one
/// program    stated as the application, such as "lamina 0.1.0"
/// errors     kOutput; kInput: an object without any triangle of three different corners, which 3MF cannot hold (begins with
///            the object's name, not with a file's)
/// cost       parallel; 60 bytes a vertex while an object is indexed, and the compressed file (about 10 bytes a triangle)
/// source     3MF Consortium, Core Specification 1.3, sections 3 and 4
Result<Mesh3mfCounts> write_mesh_3mf(File& file, std::span<const Mesh3mfObject> objects, std::span<const Instance> instances,
                                     std::string_view program);

/// Gathers slices, deflated as they come, about 5 bytes a point, and writes the package at the end: each body's slices stand
/// in one piece there, and a layer brings a slice of every body. Numbers are exact to the nanometre. Coordinates count from
/// the whole mm below the front left of all parts, where the build items stand.
class Slice3mfWriter {
 public:
  /// head  one object for each body, with a box as its mesh where none is given: the extension wants one
  /// errors  of check_3mf_date
  static Result<Slice3mfWriter> make(const SliceHead& head);

  /// Layers from the bottom up. errors  kOutput
  Status add(const SliceLayer& layer);
  /// Writes the package; it takes its name when the file is finished. errors  kOutput
  Result<File> write(const std::string& path, const FileOptions& options = {});

 private:
  struct PartBody {
    std::string name;
    Deflated slices;
    Buffer<char> waiting;  // text that is deflated when there is enough of it
  };
  explicit Slice3mfWriter(const SliceHead& head);
  std::string objects_and_build() const;

  Box bounds_;
  Nm first_bottom_;
  std::int64_t left_, front_;  // nm, whole mm: where the items stand, and what their coordinates count from
  std::vector<PartBody> bodies_;
};

}  // namespace lamina::formats

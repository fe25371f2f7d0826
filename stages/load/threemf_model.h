// stages/load/threemf_model.h: what lamina takes from a 3MF model, free of the library that reads it; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stages/load/reader.h"

namespace lamina::load {

/// An object as in the file: a mesh, or components that name other objects.
struct ModelObject {
  enum class Type { kModel, kOther, kSupport };
  struct Component {
    std::uint32_t object;  // index in ModelFile::objects
    Transform transform;   // in the file's unit
  };
  std::uint32_t id = 0;  // counted by lib3mf in the order of the file, which need not be its own number
  std::string name;
  Type type = Type::kModel;
  Buffer<std::array<double, 3>> vertices;  // decimal_of() what lib3mf has
  Buffer<std::array<std::uint32_t, 3>> triangles;
  std::vector<Component> components;
};

struct ModelFile {
  double unit_mm = 1;
  std::vector<ModelObject> objects;
  std::vector<ModelObject::Component> items;  // of the build
  std::vector<std::string> warnings;
};

/// Reads a file that check_package() has passed.
/// errors  kInput with lib3mf's words
Result<ModelFile> read_model(const Source& source);

/// An object that is printed, with everything that happens to its coordinates before they are in mm on the bed.
struct Leaf {
  std::uint32_t object;
  Transform transform;
  std::uint32_t item;  // from 0
};

/// Follows components down to meshes; what a file may contain was checked before (component_scan.h).
std::vector<Leaf> expand(const ModelFile& model, std::vector<Note>& notes);

}  // namespace lamina::load

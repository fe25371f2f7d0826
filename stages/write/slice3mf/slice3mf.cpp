#include "stages/write/slice3mf/slice3mf.h"

#include <fmt/format.h>

#include <array>
#include <cstring>

#include "stages/data/handles/lib3mf.h"
#include "stages/write/file.h"

namespace lamina::write {
namespace {

using Handle = Lib3mfHandle;

Error refused(std::string_view what, const Handle& handle) {
  return {Fault::kOutput, fmt::format("3MF: {} failed: {}", what, handle.last_error())};
}

/// The library would draw random ones; the same slices shall give the same bytes. Version 8: of our own making (RFC 9562).
std::string uuid(std::uint32_t kind, std::size_t number) {
  return fmt::format("6c616d69-6e61-8000-8000-{:04x}{:08x}", kind, number);
}

float float_mm(std::int64_t nm) { return static_cast<float>(mm(nm)); }

/// The box that stands for a body where slices say what it is (mesh resolution "lowres").
Status set_box(const Handle& object, const Box& box, std::int64_t left, std::int64_t front) {
  std::array<NMR::MODELMESHVERTEX, 8> vertices{};
  for (std::size_t i = 0; i < 8; ++i) {
    vertices[i].m_fPosition[0] = float_mm(((i & 1) != 0 ? box.hi.x : box.lo.x) - left);
    vertices[i].m_fPosition[1] = float_mm(((i & 2) != 0 ? box.hi.y : box.lo.y) - front);
    vertices[i].m_fPosition[2] = float_mm((i & 4) != 0 ? box.hi.z : box.lo.z);
  }
  constexpr DWORD kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                   {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  std::array<NMR::MODELMESHTRIANGLE, 12> triangles{};
  for (std::size_t i = 0; i < 12; ++i) std::copy(std::begin(kFaces[i]), std::end(kFaces[i]), triangles[i].m_nIndices);
  if (NMR::lib3mf_meshobject_setgeometry(object.get(), vertices.data(), 8, triangles.data(), 12) != LIB3MF_OK) {
    return refused("a mesh", object);
  }
  return {};
}

/// The package as the library writes it: it goes back to fill in lengths.
struct Package {
  Buffer<std::byte> bytes;
  std::size_t at = 0;
};

std::uint32_t write_piece(const BYTE* data, std::uint32_t size, void* user) {
  auto& package = *static_cast<Package*>(user);
  if (package.bytes.size() < package.at + size) package.bytes.resize(package.at + size);
  std::memcpy(package.bytes.data() + package.at, data, size);
  package.at += size;
  return 0;
}

std::uint32_t seek_piece(std::uint64_t position, void* user) {
  static_cast<Package*>(user)->at = position;
  return 0;
}

}  // namespace

struct Slice3mfWriter::State {
  Handle model;
  std::int64_t left = 0, front = 0;  // nm, whole mm: where the items stand, and what their coordinates count from
  std::vector<Handle> stacks;        // one for each body
};

Slice3mfWriter::Slice3mfWriter() : state_(std::make_unique<State>()) {}
Slice3mfWriter::Slice3mfWriter(Slice3mfWriter&&) noexcept = default;
Slice3mfWriter::~Slice3mfWriter() = default;

Result<Slice3mfWriter> Slice3mfWriter::make(const SliceHead& head) {
  Slice3mfWriter writer;
  Handle& model = writer.state_->model;
  if (NMR::lib3mf_createmodel(model.out()) != LIB3MF_OK) return refused("a model", model);
  if (NMR::lib3mf_model_setunit(model.get(), NMR::MODELUNIT_MILLIMETER) != LIB3MF_OK) return refused("the unit", model);
  if (NMR::lib3mf_model_setbuilduuidutf8(model.get(), uuid(0, 0).c_str()) != LIB3MF_OK) return refused("a UUID", model);
  // The library writes six significant digits: the less they have to tell, the finer they are.
  State& state = *writer.state_;
  state.left = floor_div<std::int64_t>(head.bounds.lo.x, kNmPerMm) * kNmPerMm;
  state.front = floor_div<std::int64_t>(head.bounds.lo.y, kNmPerMm) * kNmPerMm;
  NMR::MODELTRANSFORM place{};
  for (std::size_t i = 0; i < 3; ++i) place.m_fFields[i][i] = 1;
  place.m_fFields[0][3] = float_mm(state.left);
  place.m_fFields[1][3] = float_mm(state.front);
  std::size_t number = 0;
  for (const std::string& name : head.parts) {
    ++number;
    Handle stack, object, item;
    if (NMR::lib3mf_model_addslicestack(model.get(), float_mm(head.first_bottom), stack.out()) != LIB3MF_OK) {
      return refused("a slice stack", model);
    }
    if (NMR::lib3mf_model_addmeshobject(model.get(), object.out()) != LIB3MF_OK) return refused("an object", model);
    if (auto status = set_box(object, head.bounds, state.left, state.front); !status) return status.error();
    if (NMR::lib3mf_object_setnameutf8(object.get(), name.c_str()) != LIB3MF_OK) return refused("a name", object);
    if (NMR::lib3mf_object_setuuidutf8(object.get(), uuid(1, number).c_str()) != LIB3MF_OK) return refused("a UUID", object);
    if (NMR::lib3mf_meshobject_setslicestack(object.get(), stack.get()) != LIB3MF_OK) return refused("a stack", object);
    if (NMR::lib3mf_meshobject_setslicesmeshresolution(object.get(), NMR::MODELSLICESMESHRESOLUTION_LOW) != LIB3MF_OK) {
      return refused("the mesh resolution", object);
    }
    if (NMR::lib3mf_model_addbuilditem(model.get(), object.get(), &place, item.out()) != LIB3MF_OK) {
      return refused("a build item", model);
    }
    if (NMR::lib3mf_builditem_setuuidutf8(item.get(), uuid(2, number).c_str()) != LIB3MF_OK) return refused("a UUID", item);
    writer.state_->stacks.push_back(std::move(stack));
  }
  return writer;
}

Status Slice3mfWriter::add(const SliceLayer& layer) {
  std::vector<NMR::MODELSLICEVERTEX> vertices;
  std::vector<DWORD> indices;
  for (std::size_t b = 0; b < state_->stacks.size(); ++b) {
    const Handle& stack = state_->stacks[b];
    Handle slice;
    const float top = float_mm(std::int64_t{layer.layer.bottom} + layer.layer.thickness);
    if (NMR::lib3mf_slicestack_addslice(stack.get(), top, slice.out()) != LIB3MF_OK) return refused("a slice", stack);
    for (std::uint32_t c = layer.body[b]; c < layer.body[b + 1]; ++c) {
      vertices.clear();
      for (const Point2 p : layer.contours[c])
        vertices.push_back({{float_mm(p.x - state_->left), float_mm(p.y - state_->front)}});
      DWORD first = 0, polygon = 0;
      const auto count = static_cast<DWORD>(vertices.size());
      if (NMR::lib3mf_slice_addvertices(slice.get(), vertices.data(), count, &first) != LIB3MF_OK) {
        return refused("vertices", slice);
      }
      indices.clear();
      for (DWORD i = 0; i < count; ++i) indices.push_back(first + i);
      indices.push_back(first);  // closed
      if (NMR::lib3mf_slice_addpolygon(slice.get(), indices.data(), count + 1, &polygon) != LIB3MF_OK) {
        return refused("a polygon", slice);
      }
    }
  }
  return {};
}

Status Slice3mfWriter::finish(const std::string& path) {
  Handle writer;
  if (NMR::lib3mf_model_querywriter(state_->model.get(), "3mf", writer.out()) != LIB3MF_OK) {
    return refused("a writer", state_->model);
  }
  // Into memory: the library ends the program where a disk is full.
  Package package;
  void* write = reinterpret_cast<void*>(write_piece);
  void* seek = reinterpret_cast<void*>(seek_piece);
  if (NMR::lib3mf_writer_writetocallback(writer.get(), write, seek, &package) != LIB3MF_OK) {
    return Error{Fault::kOutput, fmt::format("{}: {}", path, refused("writing", writer).message)};
  }
  return write_file(path, package.bytes);
}

}  // namespace lamina::write

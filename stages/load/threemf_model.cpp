// stages/load/threemf_model.cpp: 3MF files are read through lib3mf (1.8, C interface), here alone.
#include <fmt/core.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif

#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <utility>

#include "stages/data/handles/lib3mf.h"
#include "stages/load/threemf_model.h"

namespace lamina::load {
namespace {

using Handle = Lib3mfHandle;

bool done(LIB3MFRESULT result) { return result == LIB3MF_OK; }

/// The shortest decimal number that makes this float. lib3mf reads 0.1 into a float; this gives 0.1 back in double
/// precision, so that a number of up to seven places means the same in 3MF as in OBJ or ASCII STL.
double decimal_of(float number) {
  if (!std::isfinite(number)) return static_cast<double>(number);
  std::array<char, 32> text;
  const auto written = std::to_chars(text.data(), text.data() + text.size(), number);
  double value = 0;
  std::from_chars(text.data(), written.ptr, value);
  return value;
}

/// lib3mf keeps 3 rows of 4, the last column being the translation.
Transform transform_of(const NMR::MODELTRANSFORM& matrix) {
  Transform transform;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      transform.linear[3 * row + column] = decimal_of(matrix.m_fFields[row][column]);
    transform.translation[row] = decimal_of(matrix.m_fFields[row][3]);
  }
  return transform;
}

double unit_in_mm(DWORD unit) {
  switch (unit) {
    case NMR::MODELUNIT_MICROMETER: return 0.001;
    case NMR::MODELUNIT_CENTIMETER: return 10;
    case NMR::MODELUNIT_INCH: return 25.4;
    case NMR::MODELUNIT_FOOT: return 304.8;
    case NMR::MODELUNIT_METER: return 1000;
    default: return 1;
  }
}

bool read_mesh(const Handle& handle, ModelObject& object) {
  DWORD vertices = 0, triangles = 0, got = 0;
  if (!done(NMR::lib3mf_meshobject_getvertexcount(handle.get(), &vertices)) ||
      !done(NMR::lib3mf_meshobject_gettrianglecount(handle.get(), &triangles)))
    return false;
  static_assert(sizeof(NMR::MODELMESHTRIANGLE) == 12);
  Buffer<NMR::MODELMESHVERTEX> floats(vertices);
  object.triangles.resize(triangles);
  if (vertices > 0 &&
      (!done(NMR::lib3mf_meshobject_getvertices(handle.get(), floats.data(), vertices, &got)) || got != vertices))
    return false;
  object.vertices.resize(vertices);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices, 4096), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i)
      for (std::size_t axis = 0; axis < 3; ++axis) object.vertices[i][axis] = decimal_of(floats[i].m_fPosition[axis]);
  });
  return triangles == 0 ||
         (done(NMR::lib3mf_meshobject_gettriangleindices(
              handle.get(), reinterpret_cast<NMR::MODELMESHTRIANGLE*>(object.triangles.data()), triangles, &got)) &&
          got == triangles);
}

/// Components with the identifiers of the file, to be turned into indices when all objects are known.
bool read_components(const Handle& handle, ModelObject& object) {
  DWORD count = 0;
  if (!done(NMR::lib3mf_componentsobject_getcomponentcount(handle.get(), &count))) return false;
  for (DWORD i = 0; i < count; ++i) {
    Handle component;
    DWORD id = 0;
    NMR::MODELTRANSFORM matrix;
    if (!done(NMR::lib3mf_componentsobject_getcomponent(handle.get(), i, component.out())) ||
        !done(NMR::lib3mf_component_getobjectresourceid(component.get(), &id)) ||
        !done(NMR::lib3mf_component_gettransform(component.get(), &matrix)))
      return false;
    object.components.push_back({id, transform_of(matrix)});
  }
  return true;
}

std::string name_of(const Handle& handle) {
  ULONG needed = 0;
  if (!done(NMR::lib3mf_object_getnameutf8(handle.get(), nullptr, 0, &needed)) || needed == 0) return {};
  std::string name(needed + 1, '\0');
  if (!done(NMR::lib3mf_object_getnameutf8(handle.get(), name.data(), static_cast<ULONG>(name.size()), &needed))) return {};
  name.resize(name.find('\0') == name.npos ? name.size() : name.find('\0'));
  return name;
}

bool read_object(const Handle& handle, ModelObject& object) {
  DWORD id = 0, type = 0;
  BOOL is_mesh = 0, is_components = 0;
  if (!done(NMR::lib3mf_resource_getresourceid(handle.get(), &id)) || !done(NMR::lib3mf_object_gettype(handle.get(), &type)) ||
      !done(NMR::lib3mf_object_ismeshobject(handle.get(), &is_mesh)) ||
      !done(NMR::lib3mf_object_iscomponentsobject(handle.get(), &is_components)))
    return false;
  object.id = id;
  object.name = name_of(handle);
  object.type = type == NMR::MODELOBJECTTYPE_MODEL   ? ModelObject::Type::kModel
                : type == NMR::MODELOBJECTTYPE_OTHER ? ModelObject::Type::kOther
                                                     : ModelObject::Type::kSupport;
  return (!is_mesh || read_mesh(handle, object)) && (!is_components || read_components(handle, object));
}

bool read_objects(const Handle& model, ModelFile& file) {
  Handle iterator;
  if (!done(NMR::lib3mf_model_getobjects(model.get(), iterator.out()))) return false;
  for (BOOL more = 0; done(NMR::lib3mf_resourceiterator_movenext(iterator.get(), &more)) && more;) {
    Handle resource;
    ModelObject object;
    if (!done(NMR::lib3mf_resourceiterator_getcurrent(iterator.get(), resource.out())) || !read_object(resource, object))
      return false;
    file.objects.push_back(std::move(object));
  }
  return true;
}

bool read_items(const Handle& model, ModelFile& file) {
  Handle iterator;
  if (!done(NMR::lib3mf_model_getbuilditems(model.get(), iterator.out()))) return false;
  for (BOOL more = 0; done(NMR::lib3mf_builditemiterator_movenext(iterator.get(), &more)) && more;) {
    Handle item;
    DWORD id = 0;
    NMR::MODELTRANSFORM matrix;
    if (!done(NMR::lib3mf_builditemiterator_getcurrent(iterator.get(), item.out())) ||
        !done(NMR::lib3mf_builditem_getobjectresourceid(item.get(), &id)) ||
        !done(NMR::lib3mf_builditem_getobjecttransform(item.get(), &matrix)))
      return false;
    file.items.push_back({id, transform_of(matrix)});
  }
  return true;
}

bool resolve(const std::map<std::uint32_t, std::uint32_t>& index_of, std::vector<ModelObject::Component>& components) {
  for (auto& component : components) {
    const auto found = index_of.find(component.object);
    if (found == index_of.end()) return false;
    component.object = found->second;
  }
  return true;
}

bool read_file(const Handle& reader, const std::string& path) {
#ifdef __SANITIZE_ADDRESS__
  const __lsan::ScopedDisabler known;  // lib3mf 1.8 leaks libzip's 160 bytes for each entry that it opens
#endif
  return done(NMR::lib3mf_reader_readfromfileutf8(reader.get(), path.c_str()));
}

void read_warnings(const Handle& reader, ModelFile& file) {
  DWORD count = 0;
  if (!done(NMR::lib3mf_reader_getwarningcount(reader.get(), &count))) return;
  for (DWORD i = 0; i < count && i < 3; ++i) {
    DWORD code = 0;
    ULONG needed = 0;
    std::array<char, 512> text{};
    if (done(NMR::lib3mf_reader_getwarningutf8(reader.get(), i, &code, text.data(), text.size() - 1, &needed)))
      file.warnings.emplace_back(text.data());
  }
}

}  // namespace

Result<ModelFile> read_model(const Source& source) {
  Handle model, reader;
  if (!done(NMR::lib3mf_createmodel(model.out())) || !done(NMR::lib3mf_model_queryreader(model.get(), "3mf", reader.out())))
    return Error{Fault::kInternal, "lib3mf cannot be started"};
  if (!read_file(reader, source.path()))
    return source.error(fmt::format("is not a valid 3MF file ({}); export it again", reader.last_error()));
  ModelFile file;
  read_warnings(reader, file);
  DWORD unit = NMR::MODELUNIT_MILLIMETER;
  if (!done(NMR::lib3mf_model_getunit(model.get(), &unit)) || !read_objects(model, file) || !read_items(model, file))
    return source.error(fmt::format("is not a valid 3MF file ({}); export it again", model.last_error()));
  file.unit_mm = unit_in_mm(unit);
  std::map<std::uint32_t, std::uint32_t> index_of;
  for (std::uint32_t i = 0; i < file.objects.size(); ++i) index_of.emplace(file.objects[i].id, i);
  bool resolved = resolve(index_of, file.items);
  for (ModelObject& object : file.objects) resolved = resolved && resolve(index_of, object.components);
  if (!resolved) return source.error("names an object that it does not hold; export it again");
  return file;
}

}  // namespace lamina::load

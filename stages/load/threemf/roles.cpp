#include "stages/load/threemf/roles.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "stages/load/text.h"
#include "stages/load/threemf/xml.h"

namespace lamina::load {
namespace {

/// A volume or a component of an object, as settings name it.
struct Named {
  std::uint64_t object = 0, part = 0;  // ids; the part is a component, or 0 for a range of triangles
  Volume volume;
};

std::uint64_t number_of(std::string_view text) {
  std::uint64_t number = UINT64_MAX;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

/// The roles that none of these programs prints: any other is left out, and reported.
Role role_of(std::string_view type) {
  if (type == "ModelPart" || type == "normal_part" || type == "0" || type.empty()) return Role::kPart;
  return type == "NegativeVolume" || type == "negative_part" ? Role::kNegative : Role::kModifier;
}

/// <object id> <volume firstid lastid> <metadata key value/>, or <object id> <part id subtype> <metadata/>.
class SettingsHandler : public XmlHandler {
 public:
  std::vector<Named> found;  // what is no part

  void start(const XmlName& name, XmlAttributes attributes) override {
    ++depth_;
    if (depth_ == 2) object_ = name.local == "object" ? number_of(value(attributes, "id")) : UINT64_MAX;
    if (depth_ == 3) {
      in_volume_ = object_ != UINT64_MAX && (name.local == "volume" || name.local == "part");
      now_ = {object_, 0, {number_of(value(attributes, "firstid")), number_of(value(attributes, "lastid")), Role::kPart, {}}};
      if (name.local == "part") now_.part = number_of(value(attributes, "id"));
      now_.volume.role = role_of(value(attributes, "subtype"));
    }
    if (depth_ == 4 && in_volume_ && name.local == "metadata") {
      const std::string_view key = value(attributes, "key"), is = value(attributes, "value");
      if (key == "name") now_.volume.name = is;
      if (key == "volume_type" || (key == "modifier" && is == "1")) now_.volume.role = role_of(is);
    }
  }

  void end() override {
    if (depth_-- == 3 && std::exchange(in_volume_, false) && now_.volume.role != Role::kPart) found.push_back(std::move(now_));
  }

 private:
  static std::string_view value(XmlAttributes attributes, std::string_view name) {
    const char* const found = find_attribute(attributes, name);
    return found != nullptr ? found : "";
  }

  std::uint32_t depth_ = 0;
  std::uint64_t object_ = UINT64_MAX;
  bool in_volume_ = false;
  Named now_;
};

void give(const Named& named, ModelPackage& package) {
  const auto at = package.object_of_id.find({0, named.object});
  if (at == package.object_of_id.end()) return;
  ModelObject& object = package.objects[at->second];
  if (named.part == 0) return object.volumes.push_back(named.volume);
  for (ObjectReference& component : object.components)
    if (component.id == named.part) component.role = named.volume.role;
  if (object.components.empty() && object.id == named.part) object.role = named.volume.role;
}

Status read_settings(Archive& archive, const std::string& name, ModelPackage& package, std::vector<Note>& notes) {
  SettingsHandler handler;
  XmlReader reader(handler);
  bool whole = true;
  const Status read = archive.read(name, [&](std::string_view bytes) {
    whole = whole && reader.feed(bytes);
    return Status();
  });
  if (!read) return read;
  if (!whole || !reader.finish())
    notes.push_back({false, fmt::format("{}, {}; what this says of volumes is not known, and all are planned as solids",
                                        name.substr(1), reader.fault())});
  for (const Named& one : handler.found) give(one, package);
  return {};
}

/// Takes the triangles of modifiers out, which leaves those of parts and of what takes material away.
Status take_out_modifiers(const Source& source, const ModelPackage& package, ModelObject& object) {
  const std::uint64_t count = object.triangles.size();
  std::sort(object.volumes.begin(), object.volumes.end(),
            [](const Volume& one, const Volume& other) { return one.first < other.first; });
  std::size_t kept = 0;
  std::uint64_t next = 0;
  for (const Volume& volume : object.volumes) {
    if (volume.first > volume.last || volume.last >= count)
      return source.error(fmt::format("{} has {} triangles, and a volume {} of triangles {} to {}; export it again",
                                      label(package, object), count, quoted(std::string_view(volume.name)), volume.first,
                                      volume.last));
    if (volume.role != Role::kModifier) continue;
    for (; next < volume.first; ++next) object.triangles[kept++] = object.triangles[next];
    next = std::max(next, volume.last + 1);
  }
  for (; next < count; ++next) object.triangles[kept++] = object.triangles[next];
  object.triangles.resize(kept);
  return {};
}

}  // namespace

void apply_cura_setting(std::string_view key, std::string_view value, ModelObject& object) {
  if (!is_word(value, "true") && value != "1") return;
  if (key == "support_mesh") object.type = ModelObject::Type::kSupport;
  // What Cura prints is the same solid without them, but otherwise.
  if (key == "infill_mesh" || key == "cutting_mesh" || key == "anti_overhang_mesh") object.role = Role::kModifier;
}

Status apply_roles(const Source& source, Archive& archive, ModelPackage& package, std::vector<Note>& notes) {
  for (const char* name : {"/metadata/slic3r_pe_model.config", "/metadata/superslicer_model.config",
                           "/metadata/slic3r_model.config", "/metadata/model_settings.config"}) {
    if (!archive.has(name)) continue;
    if (const Status read = read_settings(archive, name, package, notes); !read) return read;
    break;
  }
  for (ModelObject& object : package.objects) {
    if (object.volumes.empty()) continue;
    if (const Status taken = take_out_modifiers(source, package, object); !taken) return taken;
  }
  return {};
}

}  // namespace lamina::load

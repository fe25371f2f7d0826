// stages/load/threemf/model_parser.h: the XML of a 3MF model becomes objects and build items; internal to load.
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "stages/load/threemf/model.h"
#include "stages/load/threemf/properties.h"
#include "stages/load/threemf/xml.h"

namespace lamina::load {

/// Understands the core specification and the paths of the production extension, of any prefix. Properties of materials are
/// passed over; what other extensions say is counted, or noted by its namespace. Unknown attributes do not matter.
///
/// source  3MF Consortium, Core Specification 1.3; Production Extension 1.1
class ModelParser : public XmlHandler {
 public:
  /// package         gets what is found; a path to a file that it does not know adds it
  /// file            index in package.files: the one that is parsed
  /// triangle_limit  of all objects of the package together
  ModelParser(ModelPackage& package, std::uint32_t file, std::uint64_t triangle_limit)
      : package_(package), file_(file), triangle_limit_(triangle_limit) {}

  /// The reader that calls this; set before it is fed.
  void attach(XmlReader& reader) { reader_ = &reader; }

  void start(const XmlName& name, XmlAttributes attributes) override;
  void end() override;
  void text(std::string_view piece) override { metadata_.back().text(piece); }

  bool has_build() const { return has_build_; }

 private:
  enum class Element {
    kModel,
    kResources,
    kProperties,
    kObject,
    kMesh,
    kVertices,
    kTriangles,
    kComponents,
    kBuild,
    kItem,
    kMetadataGroup,
    kMetadata,
    kLattice,
    kVolumes,
    kPassedOver
  };

  Element element_of(const XmlName& name, XmlAttributes attributes);
  Element in_core(std::string_view name, XmlAttributes attributes);
  Element in_extension(const XmlName& name, XmlAttributes attributes);
  Element not_known(std::string_view name, XmlAttributes attributes);
  Element property(std::string_view name, XmlAttributes attributes);
  Element metadata_group();
  Element metadata(std::string_view name, XmlAttributes attributes);
  void volume(XmlAttributes attributes);
  void pass_over_attributes(XmlAttributes attributes);
  void pass_over_attribute(const XmlName& name);
  void model(const XmlName& name, XmlAttributes attributes);
  void require(std::string_view prefixes);
  std::uint64_t resource(std::string_view name, XmlAttributes attributes);
  void object(XmlAttributes attributes);
  void vertex(XmlAttributes attributes);
  void triangle(XmlAttributes attributes);
  void reference(std::string_view what, XmlAttributes attributes, std::vector<ObjectReference>& to);
  XmlName attribute_name(const char* name);
  bool read_id(std::string_view text, std::uint64_t& id);
  bool read_matrix(std::string_view text, Transform& transform);
  void pass_over(std::string_view space);
  void refuse(std::string what) { reader_->refuse(std::move(what)); }
  ModelObject& current() { return package_.objects.back(); }

  ModelPackage& package_;
  std::uint32_t file_;
  std::uint64_t triangle_limit_;
  XmlReader* reader_ = nullptr;
  std::string core_;               // the namespace of <model>
  std::vector<Element> elements_;  // of the elements that are open
  std::set<std::uint64_t> ids_;    // of all resources of this file
  Properties properties_;
  std::vector<Metadata> metadata_{1};  // of the model, and of the group that is open
  bool has_resources_ = false, has_build_ = false;
};

}  // namespace lamina::load

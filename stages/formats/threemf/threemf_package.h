// stages/formats/threemf/threemf_package.h: what every 3MF file has around its model.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/status.h"
#include "stages/formats/zip/zip.h"
#include "stages/support/io/file.h"

namespace lamina::formats {

/// Checks the date of the packages, before anything is made for one. errors  kUsage: SOURCE_DATE_EPOCH is no number
Status check_3mf_date();

/// Writes [Content_Types].xml, _rels/.rels and 3D/3dmodel.model, in this order, of the date that the environment's
/// SOURCE_DATE_EPOCH says, else of 1 January 1980.
///
/// model   the text of the model in pieces
/// errors  kOutput; kUsage: that variable is no number
/// source  ISO/IEC 29500-2 (Open Packaging Conventions); 3MF Consortium, Core Specification 1.3, section 2
Status write_3mf_package(File& file, std::span<const Deflated> model);

inline constexpr std::string_view kXmlDeclaration = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
inline constexpr std::string_view kCore3mf = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";

/// Text for an attribute of XML: markup is escaped; bytes that are no UTF-8, and control characters, which XML cannot hold,
/// become question marks.
std::string xml_text(std::string_view text);

/// Appends ` name="number"`.
void append_attribute(Buffer<char>& out, std::string_view name, std::uint64_t number);
/// Appends ` name="mm"` with all digits of a nanometre.
void append_attribute_mm(Buffer<char>& out, std::string_view name, std::int64_t nm);

}  // namespace lamina::formats

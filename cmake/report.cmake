# The page of `lamina report` becomes part of the program, so that an installed one finds it wherever it is.
set(report_folder ${PROJECT_SOURCE_DIR}/stages/view/report)
foreach(kind html css js)
  file(READ ${report_folder}/report.${kind} report_${kind})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${report_folder}/report.${kind})
endforeach()
set(report_source ${PROJECT_BINARY_DIR}/report_page.cpp)
file(CONFIGURE OUTPUT ${report_source} @ONLY CONTENT [[// Made from stages/view/report/ by cmake/report.cmake.
#include "stages/view/report/page.h"

namespace lamina::view::report {

const PageTexts& page_texts() {
  static constexpr PageTexts kTexts = {R"page(@report_html@)page", R"page(@report_css@)page", R"page(@report_js@)page"};
  return kTexts;
}

}  // namespace lamina::view::report
]])

target_sources(lamina_stages PRIVATE ${report_source})

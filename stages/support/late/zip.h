// stages/support/late/zip.h: libzip's functions, and libzip when it is first needed: it brings libcrypto with it.
#pragma once

#include <zip.h>

#include "stages/data/status.h"
#include "stages/support/late/late.h"

#define LAMINA_ZIP(each)                                                                                              \
  each(zip_error_init) each(zip_error_fini) each(zip_error_strerror) each(zip_strerror) each(zip_file_strerror)       \
      each(zip_source_function_create) each(zip_source_free) each(zip_source_seek_compute_offset)                     \
          each(zip_source_make_command_bitmap) each(zip_open_from_source) each(zip_discard) each(zip_get_num_entries) \
              each(zip_stat_init) each(zip_stat_index) each(zip_fopen_index) each(zip_fread) each(zip_fclose)

namespace lamina {

LAMINA_ZIP(LAMINA_LATE_DECLARED)

/// Before the first call of any of these; by any thread. errors  of load_library()
Status load_zip();

}  // namespace lamina

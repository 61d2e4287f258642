# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Finds LTTng-UST, which has no CMake package. Defines the target LttngUst::LttngUst.
find_path(LttngUst_INCLUDE_DIR lttng/tracepoint.h)
find_library(LttngUst_LIBRARY lttng-ust)
find_library(LttngUst_COMMON_LIBRARY lttng-ust-common)
mark_as_advanced(LttngUst_INCLUDE_DIR LttngUst_LIBRARY LttngUst_COMMON_LIBRARY)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(LttngUst
  REQUIRED_VARS LttngUst_LIBRARY LttngUst_COMMON_LIBRARY LttngUst_INCLUDE_DIR)

if(LttngUst_FOUND AND NOT TARGET LttngUst::LttngUst)
  add_library(LttngUst::LttngUst UNKNOWN IMPORTED)
  set_target_properties(LttngUst::LttngUst PROPERTIES
    IMPORTED_LOCATION ${LttngUst_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${LttngUst_INCLUDE_DIR}
    INTERFACE_LINK_LIBRARIES "${LttngUst_COMMON_LIBRARY};${CMAKE_DL_LIBS}")
endif()

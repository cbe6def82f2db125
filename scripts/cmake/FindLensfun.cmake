# Lensfun and its database (its pkg-config file asks for GLib's headers, which nobody needs). Defines
# Lensfun::Lensfun and Lensfun_DATA_DIR.
find_path(Lensfun_INCLUDE_DIR lensfun/lensfun.h)
find_library(Lensfun_LIBRARY lensfun)
find_path(Lensfun_DATA_DIR misc.xml PATH_SUFFIXES share/lensfun/version_1)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Lensfun
  REQUIRED_VARS Lensfun_LIBRARY Lensfun_INCLUDE_DIR Lensfun_DATA_DIR)
if(Lensfun_FOUND AND NOT TARGET Lensfun::Lensfun)
  add_library(Lensfun::Lensfun UNKNOWN IMPORTED)
  set_target_properties(Lensfun::Lensfun PROPERTIES
    IMPORTED_LOCATION ${Lensfun_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${Lensfun_INCLUDE_DIR})
endif()

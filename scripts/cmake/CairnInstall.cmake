# `cmake --install` gives the programs, the libraries, the headers, and a package for find_package(cairn), in which every
# module is a component with an export file of its own: who wants averaging needs no OpenCV.
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/cairn)
get_property(modules GLOBAL PROPERTY CAIRN_MODULES)
set(components "")
foreach(name ${modules})
  # All modules and libraries of packages that this one needs; the modules in the order in which they are defined.
  get_property(links GLOBAL PROPERTY CAIRN_LINKS_${name})
  set(modules_${name} "")
  set(libraries_${name} "")
  foreach(link ${links})
    if(NOT link MATCHES "^cairn::(.*)")
      list(APPEND libraries_${name} ${link})
    elseif(NOT DEFINED modules_${CMAKE_MATCH_1})
      message(FATAL_ERROR "src/CMakeLists.txt: ${CMAKE_MATCH_1} must stand before ${name}")
    else()
      list(APPEND modules_${name} ${modules_${CMAKE_MATCH_1}})
      list(APPEND libraries_${name} ${libraries_${CMAKE_MATCH_1}})
    endif()
  endforeach()
  list(APPEND modules_${name} ${name})
  list(REMOVE_DUPLICATES modules_${name})
  list(REMOVE_DUPLICATES libraries_${name})
  string(APPEND components "set(cairn_${name}_modules ${modules_${name}})\n"
                           "set(cairn_${name}_libraries ${libraries_${name}})\n")
  install(TARGETS cairn_${name} EXPORT cairn_${name} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT cairn_${name} FILE cairn_${name}.cmake NAMESPACE cairn:: DESTINATION ${package_dir})
endforeach()

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/cairn DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/cairnConfig.cmake.in
  ${CMAKE_BINARY_DIR}/cairnConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/cairnConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/cairnConfig.cmake ${CMAKE_BINARY_DIR}/cairnConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindCHOLMOD.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindLensfun.cmake ${CMAKE_CURRENT_LIST_DIR}/CairnPackages.cmake
        DESTINATION ${package_dir})

# The libraries behind treemarch_io, for the build and for those who link the installed library.
find_package(HDF5 REQUIRED COMPONENTS C)
find_library(DEFLATE_LIBRARY deflate REQUIRED)
find_library(METIS_LIBRARY metis REQUIRED)
find_package(PNG REQUIRED)
find_package(TIFF REQUIRED)
find_package(ZLIB REQUIRED)
find_package(pugixml REQUIRED)

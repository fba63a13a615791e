"""Offsets of the contexts of each syntax element."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SPLIT = 0  # block size 3 × smaller neighbours 3 × doubt 4
SYNTHESIS = SPLIT + 36  # block size 4 × such neighbours 3 × doubt 4
INTRA = SYNTHESIS + 48  # such neighbours 3
INTRA_MODE = INTRA + 3  # most probable, second, smooth
MERGE = INTRA_MODE + 3  # block size 4 × (synthesis by left: none, same, other 3; left; above)
DELTA = MERGE + 20  # 14 digits and 1 sign
# Where the index is from: coded, synthesis, left, above 4 × left and above alike 2 × as seen 2.
SAME_MASK = DELTA + 15
MASK = SAME_MASK + 16  # references 4 × reference 4 × any set before 2 × seen 2
RESIDUAL = MASK + 64  # block size 4 × (synthesis, else) 2 × such neighbours 3 × doubt 4
CODED = RESIDUAL + 96  # plane 3 × block size 4 × intra or not 2 × first plane coded 2
LAST = CODED + 48  # plane 3 × block size 4 × 12 digits
SIGNIFICANT = LAST + 144  # plane 3 × block size 4 × place 4 × neighbourhood 8
ABOVE_ONE = SIGNIFICANT + 384  # plane 3 × neighbourhood 8 × at the mean 2
ABOVE_TWO = ABOVE_ONE + 48
REST = ABOVE_TWO + 48  # plane 3 × 16 digits
BLEND = REST + 48
# Contexts that are mixed with those of SIGNIFICANT and ABOVE_ONE.
SIGNIFICANT_THERE = BLEND + 1  # plane 3 × block size 4 × sixteenth of the block 16 × (intra, else) 2
ABOVE_ONE_THERE = SIGNIFICANT_THERE + 384  # plane 3 × sixteenth of the block 16 × (intra, else) 2
WEIGHTS = ABOVE_ONE_THERE + 96  # of SIGNIFICANT plane 3 × block size 4, of ABOVE_ONE plane 3
EXACT = WEIGHTS + 15  # colour 3 × activity 16 × (zero 1, sign 3, prefix 12)
EXACT_REST = EXACT + 768  # 16 digits
CROSS = EXACT_REST + 16  # plane 2 × (not zero by block size 4, sign, above 1, 2 and 3)
# Of prediction in time.
IN_TIME = CROSS + 16  # block size 4 × such neighbours 3 × inherited: none, no, yes 3
MIXED = IN_TIME + 36  # block size 4 × such neighbours 3
VECTOR = MIXED + 12  # block size 4 × (inherited by left: none, same, other 3; left; above)
INSTANT = VECTOR + 20  # 3 digits
COMPONENT = INSTANT + 3  # down, across 2 × (14 digits and 1 sign)
RESIDUAL_IN_TIME = COMPONENT + 30  # block size 4 × mixed 2 × neighbours with a residual 3
# Of residuals without a transform, of two block sizes; "beside" is a class of nine.
SKIPPED = RESIDUAL_IN_TIME + 24  # block size 2 × such neighbours 3
SAMPLE_CODED = SKIPPED + 6  # plane 3 × block size 2 × first plane coded 2
SAMPLE = SAMPLE_CODED + 12  # plane 3 × block size 2 × around 8
SAMPLE_BESIDE = SAMPLE + 48  # plane 3 × block size 2 × beside 9
SAMPLE_ABOVE_ONE = SAMPLE_BESIDE + 54  # plane 3 × around 8
SAMPLE_ABOVE_ONE_BESIDE = SAMPLE_ABOVE_ONE + 24  # plane 3 × beside 9
SAMPLE_ABOVE_TWO = SAMPLE_ABOVE_ONE_BESIDE + 27  # plane 3 × around 8
SAMPLE_REST = SAMPLE_ABOVE_TWO + 24  # plane 3 × 16 digits
SAMPLE_SIGN = SAMPLE_REST + 48  # plane 3 × sign of the first plane 3
SAMPLE_WEIGHTS = SAMPLE_SIGN + 9  # plane 3 × block size 2, of above one plane 3
# Of version 7.
REST_NEAR = SAMPLE_WEIGHTS + 9  # plane 3 × larger neighbourhoods 6 × 16 digits
FILTERED = REST_NEAR + 288  # plane 3 × the view before: none, off, on 3
FILTER_SAME = FILTERED + 9  # plane 3
FILTER_CLASSES = FILTER_SAME + 3  # plane 3 × (more than one, eight)
TAP = FILTER_CLASSES + 6  # first plane or another 2 × group of taps 4 × 12 digits
# Of a dependent quantiser.
SIGNIFICANT_FINE = TAP + 96  # state 2, 3 × those of SIGNIFICANT
SIGNIFICANT_THERE_FINE = SIGNIFICANT_FINE + 2 * 384  # state 2, 3 × those of SIGNIFICANT_THERE
ABOVE_ONE_FINE = SIGNIFICANT_THERE_FINE + 2 * 384  # those of ABOVE_ONE
ABOVE_ONE_THERE_FINE = ABOVE_ONE_FINE + 48  # those of ABOVE_ONE_THERE
# Of version 9: intra modes, directions and transforms.
LIKELY = ABOVE_ONE_THERE_FINE + 96  # first, second 2 × block size 4 × intra neighbours: none, one, two, alike 4
UNDIRECTED = LIKELY + 32  # flat or smooth: block size 4; smooth
SIDE = UNDIRECTED + 5
STRAIGHT = SIDE + 1  # side 2
TURN = STRAIGHT + 2  # side 2
SLOPE = TURN + 2  # side 2 × nodes of a tree of 8 leaves 8
TRANSFORM = SLOPE + 16  # block size 4 × (not of cosines alone, of sines alone, sines across) 3
# Of version 10: blocks of unequal sides.
PARTED = TRANSFORM + 12  # first view, others 2 × area 6 × narrower or lower neighbours 3
ACROSS = PARTED + 36  # form 3 × narrower above, lower to the left 3
LAST_PARTED = ACROSS + 9  # plane 3 × area 3 × 12 digits
ENDED = LAST_PARTED + 108
# Of version 12: mixed with every other context, and with those of coefficients.
PLAIN = (
    *range(SPLIT, SIGNIFICANT),
    *range(ABOVE_TWO, SIGNIFICANT_THERE),
    *range(CROSS, SAMPLE),
    *range(SAMPLE_ABOVE_TWO, SAMPLE_WEIGHTS),
    *range(REST_NEAR, SIGNIFICANT_FINE),
    *range(LIKELY, ENDED),
)  # those of bits that are not mixed before version 12
ELEMENTS = (
    SPLIT,
    SYNTHESIS,
    INTRA,
    INTRA_MODE,
    MERGE,
    DELTA,
    SAME_MASK,
    MASK,
    RESIDUAL,
    CODED,
    LAST,
    ABOVE_TWO,
    REST,
    BLEND,
    CROSS,
    IN_TIME,
    MIXED,
    VECTOR,
    INSTANT,
    COMPONENT,
    RESIDUAL_IN_TIME,
    SKIPPED,
    SAMPLE_CODED,
    SAMPLE_ABOVE_TWO,
    SAMPLE_REST,
    SAMPLE_SIGN,
    REST_NEAR,
    FILTERED,
    FILTER_SAME,
    FILTER_CLASSES,
    TAP,
    LIKELY,
    UNDIRECTED,
    SIDE,
    STRAIGHT,
    TURN,
    SLOPE,
    TRANSFORM,
    PARTED,
    ACROSS,
    LAST_PARTED,
)  # the first context of each
HISTORY = ENDED  # element × the four bits of it before 16
RECENT = HISTORY + 16 * len(ELEMENTS)  # plain context × the two bits of the element before 4
# States 5 × plane 3 × earlier planes' magnitudes 12 × any around 2 × neighbourhood 4.
BESIDE = RECENT + 4 * len(PLAIN)
TURNED = BESIDE + 5 * 288  # states 5 × plane 3 × direction 6 × row 8 × column 8
# Of intra modes. The class of a mode is flat, smooth, from above, from the left, or straight.
LIKELY_NEAR = TURNED + 5 * 1152  # first, second 2 × class 5 × such modes around 4
LIKELY_MODE = LIKELY_NEAR + 40  # first, second 2 × mode 36 × that of the block left, below 2
LIKELY_FORM = LIKELY_MODE + 144  # first, second 2 × square, wide, tall 3 × intra neighbours 4
UNDIRECTED_SIDES = LIKELY_FORM + 24  # sides of the two likely modes: none, above, left 3 × 3
UNDIRECTED_FORM = UNDIRECTED_SIDES + 9  # directions around 4 × square, wide, tall 3
UNDIRECTED_LIKE = UNDIRECTED_FORM + 12  # directions around 4 × intra neighbours 4
SIDE_VOTES = UNDIRECTED_LIKE + 16  # votes for the left 6 × for above 6
SIDE_FORM = SIDE_VOTES + 36  # square, wide, tall 3
SIDE_SIDES = SIDE_FORM + 3  # as UNDIRECTED_SIDES
STRAIGHT_SAME = SIDE_SIDES + 9  # side 2 × straight modes of this side around 5
STRAIGHT_FORM = STRAIGHT_SAME + 10  # side 2 × square, wide, tall 3
STRAIGHT_SIDES = STRAIGHT_FORM + 6  # side 2 × as UNDIRECTED_SIDES
# Of whether a block has a residual.
RESIDUAL_MODE = STRAIGHT_SIDES + 18  # kind 5 × class of the mode 5 of intra blocks × such modes around 6, else 0
RESIDUAL_NEAR = RESIDUAL_MODE + 150  # kind 5 × residuals around 6
RESIDUAL_FORM = RESIDUAL_NEAR + 30  # height 4 × width 4 × intra or not 2
ELEMENT_WEIGHTS = RESIDUAL_FORM + 32  # element × (three weights; the bits before)
COEFFICIENT_WEIGHTS = ELEMENT_WEIGHTS + 2 * len(ELEMENTS)  # those of WEIGHTS 15 × (three weights; the fourth)
# First and second likely mode, flat or smooth, side, straight, residual 6 × (three weights; the fourth).
MODE_WEIGHTS = COEFFICIENT_WEIGHTS + 30
# Of version 14: a direction beside one of the 34, and which way.
BESIDE_PLACE = MODE_WEIGHTS + 12  # block size 4 × direction 34
BESIDE_NEAR = BESIDE_PLACE + 136  # relation of the first likely mode 6 × of the second 6
WAY_PLACE = BESIDE_NEAR + 36  # as BESIDE_PLACE
WAY_NEAR = WAY_PLACE + 136  # as BESIDE_NEAR
FOLLOWS_NEAR = WAY_NEAR + 36  # block size 4 × such neighbours 3
FOLLOWS_MODE = FOLLOWS_NEAR + 12  # class of the mode 5 × such neighbours 3
SIGN_SIZE = FOLLOWS_MODE + 15  # part of the coefficient that the border wants 8 × magnitude 6
SIGN_PLACE = SIGN_SIZE + 48  # part 8 × place in the order 8
GUIDED_WEIGHTS = SIGN_PLACE + 64  # beside, way, follows, sign 4
COUNT = GUIDED_WEIGHTS + 4
STARTING_WEIGHTS = (45875, 13107, 13107), (22938, 22938, 16384, 9830)
# Row of a context's element in `ELEMENTS`, and its place in `PLAIN`.
ELEMENT_OF = np.searchsorted(ELEMENTS, np.arange(ENDED), side="right") - 1
PLACE_OF = np.zeros(ENDED, np.int64)
PLACE_OF[list(PLAIN)] = np.arange(len(PLAIN))

# Probabilities to begin with: log(p / (1 - p)) from -6.2 up in steps of 0.2, by its digit; * where none is known. The
# mean over eight coded pictures: three scenes and a flower of a real light field camera, at two quantisers each.
DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
STARTS = (
    "TTTTVVVVWWWWllllddddaaaallll********KKKKRRRRTTTT9999NNNNWWWWCCCCOOOOZZZZNNNN********EPWMNGZcPeeYfQfg"
    "ZeRihN****TDJOF*********WONSVQXSUONSVQXSU****************ZZ****PP********ZZ**ffVV**OO****XX**ZZUUaaV"
    "V**VVXXXXYYYYllllVVVVZZZZeeeeHHHHVVVVjjjjRRRRaaaaqqqqbbbbQQQQ****aaaajjjjgggg************IIII*******"
    "*o*s*t*t*s*n*****lUiceaWl*W*i****LKRWSRUf*Q*l****zurU0*******twyroT2*****qttttrrS8***************noi"
    "P1*******oroniL4*****nrrrpkjKE***************llfN4*******nronlM5*****jpplnmpJB***************WWYYYcc"
    "cRVWXZbbbUYZZbccc********RWYXYcccOVWYZdddQVWYYdddQXXZZbbbOWUWUgggITTVXaaaLQWYXbbbOVYYZbbb***********"
    "*********************VWWWYdddOUVWZcccPVXZaccc********TVVXYcccQVUWYdddNRTWXaaaLRUVYaaaOSUVagggRSVWXdd"
    "dMSVWXcccJPTUXbbb********************************VXWXYeeeOTUVWZZZOUUVZaaa********QWWWYfffMSUVWaaaKQT"
    "VXaaaKRTUYXXXMTTXWgggONRXXdddNQUWYaaaKQUVWYYY********************************RSOKRMROURVWVWVWKNGKKMN"
    "POQSXSXSXHMDJGLKQPRTXTXTXRQQQPPRPSRTVTVTVLQLONPOQOSTWTWTWLRLPMQNQNTSYSYSYROLKLPMMQ*******RPMLNNOQ***"
    "*****SPMNIUK*********E******************************************************************************"
    "****************************************************************************************************"
    "****************************************************************************************************"
    "****************************************************************************************************"
    "****************************************************************************************************"
    "**"
)
PROBABILITIES = (
    133,
    162,
    198,
    241,
    295,
    360,
    439,
    535,
    652,
    795,
    968,
    1179,
    1434,
    1743,
    2117,
    2567,
    3108,
    3757,
    4531,
    5451,
    6537,
    7812,
    9296,
    11009,
    12964,
    15170,
    17625,
    20318,
    23222,
    26300,
    29502,
    32768,
    36034,
    39236,
    42314,
    45218,
    47911,
    50366,
    52572,
    54527,
    56240,
    57724,
    58999,
    60085,
    61005,
    61779,
    62428,
    62969,
    63419,
    63793,
    64102,
    64357,
    64568,
    64741,
    64884,
    65001,
    65097,
    65176,
    65241,
    65295,
    65338,
    65374,
)  # of each digit, in 2^-16
TRUSTED = 4  # bits that such a beginning counts as
# Of version 12, that replace those before: the mean over six photographs and two scenes, at five quantisers each.
REFINED_STARTS = (
    "BMQPKRRSOUWXKXdfTfjfZkljDfwsWkslbjo*OQPLZTTQcVUTEH76OPLGgVUVKGCDPMMPcSZZN9INfLU*pT**3OYMNGYgMdadjJhcZgNdcWjQfh"
    "eQRRMNJI******TQNbgZjXaRLdWakXZ****************UZ****TS********VX**ZZTU**OR****TU**WZNSacQU**LLKVfnHUepTXnwEIT"
    "aOMVhXQZj4DOHHRZWWjol4KVRLQckbenvFUSbOWVUXfY*CQTXVXenibfj5S**VY**aZ**6GJITXc*hXa*y*y*y*y*y*t*v*r*j7kLhFbTNDfZU"
    "9ZUV6TLXBUSiBRYeAaUlfbE0*******hljcYG0*****emmifbVG2***SgccXaULP***UUVE1*******ZbZVRD4*****ZiigbXSHE***LUWUR*U"
    "*****VWTE3*******YdaVTE5*****ZficaVTGB***JWXTR*T*****UcYbYhfkLYXYZcejMWWXYcehQWWXZdhqRZZaZfhlKXXYaehlIVVXZbehI"
    "UUWYbcgOZYbYkkoJWWZbefkHTWXYceiESUVWZchTjffdgggHTVYZegeLRVXYbdfMSTVWZckXaaZbhegLYXZffeeIWXaagccSMTS****UZZcbhf"
    "fNYXbdehkHUWaZefeDTWWadaaSWXYdhkmQXZadfgjJUWYadgjCSUWZbdf*YWYYWU*VVXdVZ**SUYX*Z**RWUWY***XdYdbggeKXZZbdcaIXXYa"
    "abaQVTW****RaabbihlNXYaaegjIUXZZdgeGUVWaYbXOYYbZkhkQWYaZfhhLUWZZcdiESVYYaed*abbWXUWPaYbZZXWMVWWUUX*AUTTU***DLF"
    "JLNNOQQSWXacgCJELKPPTQTTaWZZcAJEMKQOTRSUaXZbdJOLONOOQQRSWVabgHMJNMQOSPUSZWabeHOJPMTNRPUSZWaafROLKLPMMQ*******R"
    "PMLNNOQ********SPMNIUK*********FYdUZSWQSVZSXQVRUTXTXUXUUTVSVVXaYUcQWNSMMRXNTNRLOQTPSOTRRTQRQTTYWQaKUHNIFKUETCO"
    "GHLQFQJQMQRLQORQSTQYJSRL*KMSQT*U**QL*Q*****P******ZaNVKRILVWJSGPQMVTLRTRURMPSP*Z**TYLR8KAEPT8P9NGFRRAPONUMRIRM"
    "UOUUPVFL4D4AHM4H4EDAQO9O*K*MNI*K*U**WX*S*****U**********************ZbTWPSKNVXOTMSOPSSLTWZ*UKOSP*S**SYLTFOGGOT"
    "FSJPOOQQJRTR*KMMTN*P*NOWEQAKJFIP9MIN*OSMLOUP*TRHUO*P*RWW*O*****F**********************HUGQFNGLGQGOFMFKHOGMGLIK"
    "IMGLEKMOCLCHEDKJCIIENDTGMJLHSEUILKMHRIUTCMCJ9HIGCJEGJHPFLJJFOFUEKHMGUIUK**************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**************************************************************************************************************"
    "**********************NWZ7Naz*x*S5*3Z6*3KMQPSSTWINRQTTVUJMTOSWVY********ILRORUVY********NMNPQSTWXJKPSSUTUUE**O"
    "**T***********CSWMVVSYZ*********SNPOSTVZKJHISOTXKMKLUSXYTQRRSUUWWG**K**J**JQUKKUKRXQQQRQUVZQQNOOUTWNUPRNWUcTPL"
    "LJEH*********JBU*************PPMN************T**VSWYbV*********QMLLORNNQU******SOKJNNMMQ*******VRMJINMMQ******"
    "*aWQKINMMQ*******eZVPJKNMQ*******heaVQNKKP*******QMJLNNOQ********TOHLNNOQ********VQMMMNOQ********ZUPLLNOQ*****"
    "***cYVHNNOQ********aZVTOMOQ********QLLMIUK*********UPJMIUK*********VRMLHUK*********ZVOKJUK*********bYVQHUK****"
    "*****ZaUSLTK*********YBjY9fZ8iVggOTJRKVeXTQHP******VQQOMOU*****OPSPQUU*****************dXVRLR******YVSONP*****"
    "*WWVRPN******JJMS********YjaeXnkmOdcdglkkQeddihljYedeYlfqOdbbahgoMbbedhkmJaYbcijnJaZdeghjNdVZVjlqFYWaafhkDUZbb"
    "fhlDXZabdhhbibXaccdRWZWZcdfPTXYXcfeSVWXYYceWfYaYfffKZZbegfdMYXdcdccSW******UZYaZfhhPaXZchjhIVXabegcDVUXbaaaPYU"
    "XckkjSWYaakkiJWXZbgfg9SWWaecd*h*ZWW**WVX*YZU*UVTVT***WQYWW***VfXcahggMYZZbddZMYVYacbaVXUT****PdYaajiiNWZaZeffJ"
    "VYacedeDVYXaYZYMYUaXiikQRUcbhigMTYaafdeFTXWaacZ*f*bXUW*UXaZbYW*WTWVWX**RVWWWW**RajgbmipOeggjlnlSgfhkjllUcihqgi"
    "eQbaVbjhnLaaeelnpLabfdkkmLcbedgjiOcZaUkkoCXXZcgjmGVbcbginFYbbbghkOYebZfccWYZZcdfiSYUYbddhSUUXYZaiVYaXbgefNaccd"
    "gecLZYaZdccSa******TVZabghhPbZccmnfHVZbcedeCXVYYcbZPUYWcihjRVacZjjkLWaabejgAUXYcfgd**YWWW**WTcWXW**LbYR*SW*NV*"
    "U*W**UccaZhhgLYbZacaYLZWYabbaVYU*****QZbYYhjiMZaaaeffHVZacggfDWYYZZZXLSXaYjjjQSXcbkkgKVYabfdfDSXYZcdd**YWUZX*S"
    "ZYWWcW*SXYX*W**HTaUT***bdWXYZVVZaXXYYaYWVXXYYWWZYXXbbebWbTWTTSPVYRUSTRPVVTUTUVTVSVSYTbVQbLVLPNIPVKTHQKKRRNSPRP"
    "QTNUPVRXWTZTWXT*QSVVY*a**TR*a*****U******ZYOQWUKNUVOSKSPTPSKS*STPXRRR*X**SWJQDMDHPS9PDMLKSQIRPMQNSLUPQP*TOVCN5"
    "EA9HN5IAFIHPOFL*P*MNH*J*U**aX******************************bZPQUXPOUUOROSTUPQQQSTWSTRPSWT**UWPSHNHJPSCRINPPSQM"
    "RSQ*OQMUP*P*OPVFPDLLFLPCOLK*OSNMQ*R*PML*M*Q*RdX*W*****K**********************cfbcdbYWccbabbbYaaebdaaYcYbZbZeeX"
    "dVYVVVQWZWWWVVSZWXXYWbVZTaUbWeZTcPWNPRISWNULQPKVSSSWTbSYOZQdUdYWZNVLR*QRURY*V**MN*T*****P******YaUWTWTMXZUTVT*"
    "PYWXXUW*UbQUV*X**UYJTBMDERV9TFOLNSSLU*P*PVN*O*P**RXDO7GK9JQ8IJCQEQQLL*O*QNL*O****VW*T*****M*******************"
    "***ZaTWVWSRUXQUTWTQTTQXTbTWSS*S*V**VYPVMPQITUKVPP*NXRSS*U*TUM*R*Q**IX5P6GLBCP6JL9*FQOLN*N*RUN*H*S*UVW*S*****K*"
    "*********************IULPMNPQRUUYYbdfKOJQLRQURVVZXbbfJOKPMNPVTUVYYbddNWLTKRKOLTKRJQJPKRJQJPKONQMPKQORMQJNNLNOJ"
    "NPMRJTNPNONTKUSSMTL*O*ULRLONNOMMPLOONULROMNSMUIRNTLUL*LOTQXNTSVNQRUYRSVGPRPJSRQLRRUTUSSGMQSVTSTVS*TSWQTUU*TQUQ"
    "RUPVYXYWVZVWYUUBI*SWcKQVQWZMQTPZd01*IUZ126HOQ13D7PSPVaJTTSXimhbQ64******loldZP3G****mrmnhfcQ5Q**VXVM0*******ae"
    "dYVK1*****clkmfbZKC***WXVK0*******YfcZWK1*****bjkeccZGB***"
)
# Of version 14, from BESIDE_PLACE on: the mean over eight photographs, at five quantisers each.
GUIDED_STARTS = (
    "MQRQSSTSOOSPSQQOJ*QRSTRSSOPRQTQSMLQOUUUSUTQSSRUORLL*PUVWSUUPPSSWSUJLQSSSSTTSRSQPUQSOM*SRSUTSUOPPRXRTPO********"
    "PQ***************P********MPqKORPQiQVSqh*hfjQTe*LSKUe**SRUiRQT*ZXZVUUXTSTVWTWS**YTYUUTWXSWTUS*W**SVVVVVXUQUVUT"
    "*a**TXXVTUZYQVVUS*Y***W**TUXUNW*V***********dZT*SX**************************************VSSgKXTTR**VXT*hLXi*e*"
    "**K*M***XUX**Y***************************VVVVVVVVVUUUVVVVUUVUUUTUUUTTSSUTRRQQTRRQPOTSRRQRVVWVVVUVVUUUVVUVUVVUV"
    "VVVUUUUUVVUSSTTTUTURRRSSSSTQOQRRRSTRQRRSSRT"
)
REFINED_TRUSTED = 7


def starting_contexts(refined: bool = False) -> NDArray[np.int32]:
    """Contexts (COUNT, 3) at the beginning of a stream: two probabilities in 2^-16, and bits seen.

    Those of version 12 are ``refined``.
    """
    # Whole probabilities of every digit: decoders need not agree on an exponential function.
    found = np.array(
        [(*(2 * [PROBABILITIES[DIGITS.index(d)]]), TRUSTED) if d != "*" else (1 << 15, 1 << 15, 0) for d in STARTS]
    )
    weights = np.full((EXACT - WEIGHTS, 3), 1 << 15)
    unknown = np.tile([1 << 15, 1 << 15, 0], (COUNT - EXACT, 1))
    contexts = np.concatenate([found, weights, unknown]).astype(np.int32)
    contexts[REST_NEAR:FILTERED] = np.repeat(contexts[REST:BLEND].reshape(3, 1, 16, 3), 6, axis=1).reshape(-1, 3)
    contexts[LAST_PARTED:ENDED] = contexts[LAST:SIGNIFICANT].reshape(3, 4, 12, 3)[:, :3].reshape(-1, 3)
    for to, of, end in (
        (SIGNIFICANT_FINE, SIGNIFICANT, ABOVE_ONE),
        (SIGNIFICANT_FINE + 384, SIGNIFICANT, ABOVE_ONE),
        (SIGNIFICANT_THERE_FINE, SIGNIFICANT_THERE, ABOVE_ONE_THERE),
        (SIGNIFICANT_THERE_FINE + 384, SIGNIFICANT_THERE, ABOVE_ONE_THERE),
        (ABOVE_ONE_FINE, ABOVE_ONE, ABOVE_TWO),
        (ABOVE_ONE_THERE_FINE, ABOVE_ONE_THERE, WEIGHTS),
    ):
        contexts[to : to + end - of] = contexts[of:end]
    if refined:
        digits = REFINED_STARTS.ljust(BESIDE_PLACE, "*") + GUIDED_STARTS
        known = [i for i, digit in enumerate(digits) if digit != "*"]
        starts = np.array([PROBABILITIES[DIGITS.index(digits[i])] for i in known])
        contexts[known] = np.stack([starts, starts, np.full_like(starts, REFINED_TRUSTED)], axis=1)
    three, four = STARTING_WEIGHTS
    contexts[ELEMENT_WEIGHTS:COEFFICIENT_WEIGHTS:2] = three
    contexts[ELEMENT_WEIGHTS + 1 : COEFFICIENT_WEIGHTS : 2] = 0
    contexts[COEFFICIENT_WEIGHTS:BESIDE_PLACE:2] = four[:3]
    contexts[COEFFICIENT_WEIGHTS + 1 : BESIDE_PLACE : 2] = four[3], 0, 0
    contexts[GUIDED_WEIGHTS:] = 1 << 15
    return contexts


class Contexts:
    """Contexts of each level of a picture, or of the instants of a take one after the other.

    Those of the first instant go on from level to level, those of a later one from the same level of the instant
    before: a view needs no levels beyond its own.
    """

    def __init__(self, refined: bool) -> None:
        self._latest, self._ended = starting_contexts(refined), dict[int, NDArray[np.int32]]()

    def of(self, level: int) -> NDArray[np.int32]:
        """Return the contexts with which a level begins; coding changes them."""
        if level in self._ended:
            self._latest = self._ended[level]
        return self._latest

    def after(self, level: int) -> None:
        """Keep the contexts of a level that has ended."""
        if level not in self._ended:
            self._ended[level] = self._latest.copy()
